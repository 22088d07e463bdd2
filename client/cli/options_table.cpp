#include "client/cli/options_table.h"

#include <array>

namespace varimesh::client {
namespace {

constexpr std::array kRows{
    OptionRow{"energy", "What is minimised; default hyperelastic"},
    OptionRow{"strain",
              "Strain of the linear elastic energy; default green-lagrange. With small strain the result "
              "depends on how the mesh is rotated"},
    OptionRow{"volumetric",
              "Volumetric part of the linear elastic energy; default log. trace has no barrier and cannot "
              "keep a mesh valid"},
    OptionRow{"winslow", "Form of the Winslow energy in 3-D; default true"},
    OptionRow{"constants", "Where mu, lambda and kappa come from; default standard"},
    OptionRow{"mu", "Shear modulus; 0: from --constants"},
    OptionRow{"lambda", "First Lamé constant; 0: from --constants"},
    OptionRow{"kappa", "Bulk modulus; 0: from --constants"},
    OptionRow{"regularisation", "One δ an element or a node's patch; default element"},
    OptionRow{"method", "How the energy is minimised; default auto: sweeps, then Newton"},
    OptionRow{"colouring", "What moves together in a sweep; default group"},
    OptionRow{"active_set", "Whether sweeps pass over nodes that are at rest; default on"},
    OptionRow{"tolerance", "Stop at this residual, relative to the mesh's size; default 1e-6"},
    OptionRow{"max_iterations", "Stop after this many; default 1000; 0 checks and reports only"},
    OptionRow{"until",
              "valid: stop as soon as every element is certified valid, named unrepairable, or ten iterations "
              "bring no more; default tolerance"},
    OptionRow{"repair",
              "What is done about elements that no movement of nodes can repair; default report: name them and keep "
              "them out of the others' way. split gives tetrahedra new nodes, straighten straight sides; none treats "
              "them like any other"},
    OptionRow{"until_js", "Stop when this scaled Jacobian is proved for every element, and return the best mesh"},
    OptionRow{"time_limit", "Stop after so many seconds, at the end of an iteration; 0: never"},
    OptionRow{"threads", "Threads to use; 0: all. The result does not depend on it"},
    OptionRow{"quadrature_degree", "Degree integrated exactly; 0: twice the order"},
    OptionRow{"objective",
              "worst: raise the lowest scaled Jacobian as far as it goes, at two to twenty times the cost; default "
              "energy"},
    OptionRow{"p_norm", "Sum the cells' mean energies to this power; default 1; more presses on the worst"},
    OptionRow{"order", "Raise or lower the mesh to this order on the way in; 0: as it is"},
    OptionRow{"target", "What each cell would like to be; default straight-sided. size and strain want --target-field"},
    OptionRow{"target_field",
              "Sizes, metrics or strains: a first line 'elements' or 'nodes', then a line 'number value' each, "
              "or 'number xx xy yy [xz yz zz]'"},
    OptionRow{"fix", "Physical group whose nodes stay, by name, tag or dimension:tag; may be repeated"},
    OptionRow{"free", "Group of interface elements whose nodes may move; may be repeated"},
    OptionRow{"fix_nodes", "Numbers of nodes that stay, with the edge or face they lie in"},
    OptionRow{"free_nodes", "Numbers of nodes that may move, likewise"},
    OptionRow{"region_below", "Move nodes only near cells with a scaled Jacobian below this; 0: everywhere"},
    OptionRow{"rings", "With --region-below, layers of cells around those; default 2"},
};

}  // namespace

std::span<const OptionRow> option_rows() { return kRows; }

}  // namespace varimesh::client
