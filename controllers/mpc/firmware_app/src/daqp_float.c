/* DAQP in single precision, in one unit: its double constants are not for this processor. */
#include <float.h>
#undef DBL_EPSILON
#define DBL_EPSILON FLT_EPSILON
#include "daqp/factorization.c"
#include "daqp/auxiliary.c"
#include "daqp/daqp.c"
