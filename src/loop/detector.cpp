#include "loopd/detector.h"
