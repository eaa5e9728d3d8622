#pragma once

// Index (64 bits, signed) and Points (N x 3 doubles, row-major).
#include "core/types.h"
