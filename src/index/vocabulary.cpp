#include "index/vocabulary.h"
