// Highway's mathematical functions. A device needs none of them: number-inl.h has its own for doubles.
#pragma once

#include <hwy/highway.h>
