#pragma once

// All of the public interface.

#include "cad_model.h"
#include "derivative.h"
#include "errors.h"
#include "mesh.h"
#include "morpher.h"
#include "options.h"
#include "progress.h"
#include "report.h"
#include "threads.h"
#include "types.h"
