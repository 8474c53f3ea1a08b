#include "verify/verifier.h"
