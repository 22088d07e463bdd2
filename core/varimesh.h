// All public headers of the library.
#pragma once

#include "core/base/version.h"
#include "core/formats/formats.h"
#include "core/layers/split/split_layers.h"
#include "core/mesh/check.h"
#include "core/mesh/high_order_mesh.h"
#include "core/optimise/layers/split_result.h"
#include "core/optimise/memory.h"
#include "core/optimise/on_geometry/optimise_on_geometry.h"
#include "core/optimise/optimiser.h"
#include "core/options/options.h"
#include "core/quality/quality.h"
