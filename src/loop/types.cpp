#include "loopd/report.h"
