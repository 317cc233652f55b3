#include "kernels/patch.h"
