#include "loopd/frame.h"
