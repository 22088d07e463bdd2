// The kernels of Newton's method by name, for the processor and for cards. EACH(name, arguments, function) runs
// function(arguments, thread) in every thread, and so does EACH_PART, where kRowParts threads share a row. ADD and
// LARGEST also join what the function returns into a member of the arguments, in a tree for each block of threads.
//
// Whoever includes this file defines the four macros and the constant `d`. It has no include guard.

EACH(advance, VectorArguments, advance)
EACH(turn, VectorArguments, turn)
EACH(take_direction, VectorArguments, take_direction)
EACH(clear_step, VectorArguments, clear_step)
EACH(scale_residual, VectorArguments, scale_residual)
EACH(keep_residual, VectorArguments, keep_residual)
EACH(add_residual, VectorArguments, add_residual)
EACH(keep_start, VectorArguments, keep_start<d>)
EACH(place, VectorArguments, place<d>)
ADD(along_step, VectorArguments, along_step, parts)
ADD(square_of_gradient, VectorArguments, square_of_gradient, parts)
LARGEST(size_of_gradient, VectorArguments, size_of_gradient, parts)
LARGEST(size_of_step, VectorArguments, size_of_step<d>, parts)
LARGEST(size_of_product, VectorArguments, size_of_product<d>, parts)
ADD(add_parts, PartsArguments, add_parts, to)
LARGEST(largest_part, PartsArguments, largest_part, to)

EACH(invert_block, BlockArguments, invert_block<d>)
EACH(factorise_diagonal, CoarseArguments, factorise_diagonal<d>)
EACH(assemble_block, CoarseArguments, assemble_block<d>)
EACH(share_residual, NodeArguments, share_residual<d>)
EACH(restrict_cell, RestrictArguments, restrict_cell<d>)
EACH(add_up_coarse, CoarseArguments, add_up_coarse<d>)
EACH_PART(relax_first, CoarseArguments, relax_first<d>)
EACH_PART(relax_last, CoarseArguments, relax_last<d>)
EACH_PART(coarse_residual, CoarseArguments, coarse_residual<d>)
EACH(restrict_to_vertex, CoarseArguments, restrict_to_vertex<d>)
EACH(correct_from_vertices, CoarseArguments, correct_from_vertices<d>)
EACH(unscale, CoarseArguments, unscale<d>)
ADD(precondition, NodeArguments, precondition<d>, parts)

EACH(smooth_row, LevelArguments, smooth_row<d>)
EACH(residual_row, LevelArguments, residual_row<d>)
EACH(transfer_row, RowsArguments, transfer_row<d>)
EACH(dense_row, DenseArguments, dense_row<d>)
ADD(group_value, GroupArguments, group_value, parts)
EACH(group_product, GroupArguments, group_product)
EACH(add_groups, GroupArguments, add_groups)
