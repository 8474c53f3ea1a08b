#include "loopd/config.h"
