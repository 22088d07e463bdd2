// The kernels that add up what cells give to nodes, and those of the p-norm. Each module of cells has them. Whoever
// includes this file has the constant d, the dimension.

namespace varimesh::N_ONE_LANE {

VARIMESH_KERNEL add_up_products(device::SumArguments a) { add_up_products_of_block<d>(a); }

VARIMESH_KERNEL add_up_gradients(device::SumArguments a) { add_up_gradient<d>(a, thread()); }

VARIMESH_KERNEL keep_cell_gradients(device::NormArguments a) { keep_cell_gradient<d>(a, thread()); }

VARIMESH_KERNEL along_cell_gradients(device::NormArguments a) { along_cell_gradient<d>(a, thread()); }

VARIMESH_KERNEL add_norm_terms(device::NormArguments a) { add_norm_term<d>(a, thread()); }

}  // namespace varimesh::N_ONE_LANE
