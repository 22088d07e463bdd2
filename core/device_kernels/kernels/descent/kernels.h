// The kernels of the descent by name, besides those of the cells' energy: as kernels/solver_kernels.h has those of
// Newton's method on the energy.
//
// Whoever includes this file defines the macros EACH, ADD and LARGEST and the constant `d`. It has no include guard.

EACH(gather_values, GatherArguments, gather_values<d>)
EACH(gather_shape, ShapeArguments, gather_shape<d>)
EACH(multiply_cells, CellMatrixArguments, multiply_cells<d>)
EACH(slopes, SlopesArguments, slope_by_mode<d>)
ADD(slopes_and_value, SlopesArguments, slope_by_mode<d>, parts)
EACH(add_up_residual, OrderArguments, add_up_residual<d>)
ADD(correct, OrderArguments, correct<d>, parts)

EACH(add_up_form, LossArguments, add_up_gradient_of_form<d>)
EACH(add_form, LossArguments, add_form<d>)
ADD(held, LossArguments, held<d>, parts)
EACH(begin_system, LossArguments, begin_system)
EACH(round_direction, LossArguments, round_direction)
ADD(add_up_product, LossArguments, add_up_product<d>, parts)
EACH(advance, LossArguments, advance)
EACH(turn, LossArguments, turn)
EACH(take_direction, LossArguments, take_direction)
EACH(keep_residual, LossArguments, keep_residual)
EACH(subtract_kept, LossArguments, subtract_kept)
ADD(square_of_gradient, LossArguments, square_of_gradient, parts)
ADD(along_step, LossArguments, along_step, parts)
LARGEST(size_of_step, LossArguments, size_of_step<d>, parts)
LARGEST(size_of_product, LossArguments, size_of_product<d>, parts)
EACH(keep_start, LossArguments, keep_start<d>)
EACH(place, LossArguments, place<d>)
ADD(add_parts, PartsArguments, add_parts, to)
LARGEST(largest_part, PartsArguments, largest_part, to)
