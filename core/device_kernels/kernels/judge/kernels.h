// The kernels that judge cells by name, as kernels/solver_kernels.h has those of Newton's method.
//
// Whoever includes this file defines the macro EACH and the constant `d`. It has no include guard.

EACH(relative_nodes, RelativeArguments, relative_node<d>)
EACH(convert, RowArguments, convert_row<d>)
EACH(differentiate, RowArguments, differentiate_row<d>)
EACH(cross, RowArguments, cross_row)
EACH(coefficients, RowArguments, coefficient_row<d>)
EACH(measure, MeasureArguments, measure_cell<d>)
EACH(sample, SampleArguments, sample_cell<d>)
