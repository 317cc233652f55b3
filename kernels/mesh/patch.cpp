#include "kernels/mesh/patch.h"
