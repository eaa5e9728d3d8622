#pragma once

// Index (64 bits, signed), Points (N x 3 doubles, row-major) and RowMatrix (of any width).
#include "core/types.h"
