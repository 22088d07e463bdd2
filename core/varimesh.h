// Everything a program that links the library needs.
#pragma once

#include "core/formats/formats.h"
#include "core/mesh/check.h"
#include "core/mesh/high_order_mesh.h"
#include "core/optimise/memory.h"
#include "core/optimise/optimiser.h"
#include "core/optimise/options.h"
#include "core/quality/quality.h"
#include "core/version.h"
