// For programs that test the service without the numerical library: the formats that need HDF5 are not there.
#include "core/formats/formats.h"

bool varimesh::formats::has_hdf5() { return false; }
