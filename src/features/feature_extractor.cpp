#include "loopd/features.h"
