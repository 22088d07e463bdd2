#include "core/options/option_table.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "core/reference/shape.h"

namespace varimesh {
namespace {

using Words = std::string_view;

template <class Of, class Enum, Enum Of::*member>
constexpr ChoiceOf<Of> choice_of(std::span<const std::string_view> words) {
  return {words, [](const Of& options) { return static_cast<int>(options.*member); },
          [](Of& options, int value) { options.*member = static_cast<Enum>(value); }};
}
template <class Enum, Enum Options::*member>
constexpr ChoiceMember choice(std::span<const std::string_view> words) {
  return choice_of<Options, Enum, member>(words);
}

constexpr Words kEnergy[] = {"hyperelastic", "linear-elastic", "winslow", "distortion"};
constexpr Words kStrain[] = {"green-lagrange", "small"};
constexpr Words kVolumetric[] = {"log", "trace"};
constexpr Words kWinslow[] = {"true", "paper"};
constexpr Words kConstants[] = {"reference", "standard"};
constexpr Words kRegularisation[] = {"element", "patch"};
constexpr Words kMethod[] = {"auto", "sweeps", "newton"};
constexpr Words kColouring[] = {"group", "node"};
constexpr Words kUntil[] = {"tolerance", "valid"};
constexpr Words kLayerSpacing[] = {"keep", "even", "graded"};
constexpr Words kDevice[] = {"cpu", "gpu", "auto"};
constexpr Words kRepair[] = {"none", "report", "split", "straighten", "refine", "topology"};
constexpr Words kObjective[] = {"energy", "worst", "accuracy", "auto"};
constexpr Words kTarget[] = {"straight-sided", "ideal", "size", "strain"};

constexpr OptionRange kNotNegative{};
/// Rounding moves a node by about this fraction of its element, so no run can come closer.
constexpr double kLeastTolerance = 1e-15;
constexpr OptionRange upto(double most) { return {.most = most}; }
constexpr Words kConstantValues = "a positive number, or 0 for the value from the set of constants";

/// An option whose type says which values are possible.
constexpr OptionInfo row(Words name, OptionMember member, Words help) { return {name, member, {}, {}, help}; }
/// An option that is a number; `values` gives the range in words.
constexpr OptionInfo number(Words name, OptionMember member, OptionRange range, Words values, Words help) {
  return {name, member, range, values, help};
}

// One row per option.
const std::array kTable{
    row("energy", choice<Energy, &Options::energy>(kEnergy), "The energy that is minimised"),
    row("strain", choice<Strain, &Options::strain>(kStrain),
        "The strain of the linear elastic energy; with small the result depends on how the mesh is rotated"),
    row("volumetric", choice<Volumetric, &Options::volumetric>(kVolumetric),
        "The volumetric part of the linear elastic energy; trace has no barrier and cannot keep a mesh valid"),
    row("winslow", choice<Winslow, &Options::winslow>(kWinslow),
        "The form of the Winslow energy in 3-D: the true functional, or the one of the paper"),
    row("constants", choice<Constants, &Options::constants>(kConstants),
        "The set that mu, lambda and kappa come from if they are 0"),
    number("mu", &Options::mu, kNotNegative, kConstantValues,
           "The shear modulus, dimensionless; 0: from the set of constants"),
    number("lambda", &Options::lambda, kNotNegative, kConstantValues,
           "The first Lamé constant, dimensionless; 0: from the set of constants"),
    number("kappa", &Options::kappa, kNotNegative, kConstantValues,
           "The bulk modulus, dimensionless; 0: from the set of constants"),
    row("regularisation", choice<Regularisation, &Options::regularisation>(kRegularisation),
        "Whether each element has its own δ, or each node one δ for all elements around it"),
    row("method", choice<Method, &Options::method>(kMethod),
        "How the energy is minimised: in sweeps over the nodes, by Newton's method for all nodes at once, or "
        "(auto) sweeps until the mesh is valid, then Newton's method, and then untangling of elements that are left "
        "invalid"),
    row("colouring", choice<Colouring, &Options::colouring>(kColouring),
        "What one colour of a sweep is made of: groups of nodes, or single nodes"),
    row("active_set", &Options::active_set,
        "Whether sweeps skip nodes around which nothing has moved by more than the tolerance"),
    number("tolerance", &Options::tolerance, {.least = kLeastTolerance}, "1e-15 or more, such as 1e-3",
           "Stop when no node is further from the optimum than this fraction of the size of its elements (their "
           "shortest height)"),
    number("max_iterations", &Options::max_iterations, kNotNegative, "0 or more",
           "Stop after this many iterations; 0 only checks and reports"),
    row("until", choice<Until, &Options::until>(kUntil),
        "What else to stop at; valid: as soon as every element is certified valid or known to be unrepairable, "
        "or ten iterations certify no further element and no other method is left to try"),
    row("repair", choice<Repair, &Options::repair>(kRepair),
        "What is done about elements that no movement of nodes can repair: none treats them like any other, "
        "report names them and keeps them from distorting others, split gives tetrahedra new nodes, straighten "
        "makes triangles and tetrahedra straight-sided, refine needs a model and also splits edges on the boundary, "
        "topology also swaps and collapses edges inside"),
    number("until_js", &Options::until_js, {.most = 1, .without_most = true}, "a scaled Jacobian from 0 to below 1",
           "Stop when every element's scaled Jacobian is proved to be at least this, and return the best mesh; 0: "
           "never"),
    number("time_limit", &Options::time_limit, kNotNegative, "seconds, or 0 for no limit",
           "Stop when this many seconds have passed, with the best mesh so far; 0: never"),
    number("threads", &Options::threads, upto(4096), "1 to 4096, or 0 for all",
           "How many threads to use; the result does not depend on it; 0: all of the machine's"),
    row("device", choice<DeviceChoice, &Options::device>(kDevice),
        "Where steps of Newton's method are made: on the processor, on a graphics card (on the processor if there is "
        "none), or (auto) on a card if there is one and the mesh has at least 50,000 elements"),
    number("quadrature_degree", &Options::quadrature_degree, upto(6 * kMaxOrder), "up to 60, or 0 for twice the order",
           "The degree that the quadrature integrates exactly; 0: twice the order"),
    row("objective", choice<Objective, &Options::objective>(kObjective),
        "What the mesh is to be best at; energy stops at the energy's optimum; worst raises the lowest scaled Jacobian "
        "as far as it goes, at several times the cost; accuracy lowers what a solver loses because elements are "
        "curved; auto is energy if an option that only matters for the energy's optimum is given (such as energy, "
        "tolerance or target) or the order is 1, and accuracy otherwise"),
    number("min_js", &Options::min_js, {.most = 1, .without_most = true}, "a scaled Jacobian from 0 to below 1",
           "The scaled Jacobian that every element is to keep or reach with the objective accuracy"),
    row("layer_spacing", choice<LayerSpacing, &Options::layer_spacing>(kLayerSpacing),
        "How nodes are spaced across thin layers at walls with the objective accuracy: as they came, evenly in "
        "each element, or graded as the heights of the layers grow"),
    number("p_norm", &Options::p_norm, {.least = 1, .most = 16}, "1 (the energy itself) to 16",
           "The power to which the elements' mean energies are summed; a higher one weighs the worst elements more"),
    number("order", &Options::order, upto(kMaxOrder), "1 to 10, or 0 for the mesh's own order",
           "The order to which the mesh is raised or lowered before it is optimised; 0: as it is"),
    OptionInfo{"orient",
               &Options::orient,
               {},
               {},
               "Whether elements that came numbered clockwise are written turned, or (the default) as they came",
               "keep_orientation"},
    row("target", choice<Target, &Options::target>(kTarget),
        "The shape that each element is compared with; size and strain need a target field"),
    row("target_field", &Options::target_field,
        "A file of sizes, metrics or strains: a first line 'elements' or 'nodes', then lines 'number value' or "
        "'number xx xy yy [xz yz zz]'"),
    row("fix", &Options::fix,
        "A physical group whose nodes stay, by name, by tag or by dimension:tag; may be repeated"),
    row("free", &Options::free,
        "A group of interface elements whose nodes may move, not on the outer boundary; may be repeated"),
    row("fix_nodes", &Options::fix_nodes, "Numbers of nodes that stay, with the whole edge or face that each lies in"),
    row("free_nodes", &Options::free_nodes,
        "Numbers of nodes that may move, with the whole edge or face that each lies in"),
    number("region_below", &Options::region_below, upto(1),
           "a scaled Jacobian up to 1, or 0 to let every free node move",
           "Move nodes only near elements with a scaled Jacobian below this; 0: everywhere"),
    number("rings", &Options::rings, kNotNegative, "0 (only the elements below region_below) or more",
           "Around each element below region_below, the number of layers of elements whose nodes may move"),
};

constexpr Words kSlideOn[] = {"model", "boundary"};
constexpr Words kSlide[] = {"none", "surfaces", "all", "coupled", "auto"};

const std::array kGeometryTable{
    GeometryOption{
        "slide",
        choice_of<GeometryOptions, SlideOn, &GeometryOptions::slide>(kSlide),
        {},
        {},
        "Which boundary nodes slide: none, surfaces, all (on curves and surfaces), or coupled (the same, and "
        "then all nodes of the mesh together); auto is all, and tries coupled and none if elements are left invalid"},
    GeometryOption{
        "tolerance",
        &GeometryOptions::tolerance,
        kNotNegative,
        "a length, or 0 for twice the distance in the input",
        "With coupled sliding: how far the boundary may lie from the geometry, in the mesh's unit of length; "
        "0: twice its distance in the input",
        {},
        "geometry_tolerance"},
    GeometryOption{"snap",
                   &GeometryOptions::snap,
                   {},
                   {},
                   "First move boundary nodes that are off the geometry onto it, if they are farther from it than 1e-6 "
                   "of the mesh's size"},
    GeometryOption{"smooth_angle", &GeometryOptions::smooth_angle, upto(45), "degrees from 0 to 45",
                   "Boundary nodes cross joints at which surfaces or curves of the model meet at no more than this "
                   "angle, in degrees; 0: none"},
    GeometryOption{"slide_on",
                   choice_of<GeometryOptions, GeometrySource, &GeometryOptions::slide_on>(kSlideOn),
                   {},
                   {},
                   "What boundary nodes slide on: a CAD model, or, without one, the mesh's own curved boundary as it "
                   "came"},
    GeometryOption{
        "growth",
        &GeometryOptions::growth,
        {.least = 1},
        "a number, 1 or more",
        "With the repair refine, which splits edges on the boundary: the number of elements that the mesh may "
        "have, divided by their number in the input",
        {},
        "refine_growth"},
    GeometryOption{
        "order", &GeometryOptions::order, upto(kMaxOrder), "2 to 10, or 0 for a mesh that is curved",
        "The order with which a mesh of order 1 is first curved on the model; 0: the mesh is curved already"},
};

const std::array kLayerTable{
    LayerOption{
        "walls",
        &LayerOptions::walls,
        {},
        {},
        "Split the cells above this group of boundary elements, by name or by tag, into layers; may be repeated",
        {},
        "wall"},
    LayerOption{"layers", &LayerOptions::layers, upto(kMostLayers), "1 to 1000, or 0 if the heights give it",
                "Number of layers"},
    LayerOption{"first", &LayerOptions::first, kNotNegative, "a length, or 0 if the other numbers give it",
                "Height of the layer at the wall, in the mesh's unit of length"},
    LayerOption{"growth", &LayerOptions::growth, upto(10), "1 to 10, or 0 if the other numbers give it",
                "Height of each layer divided by the height of the layer below it"},
    LayerOption{"heights",
                &LayerOptions::heights,
                {},
                {},
                "Heights of all layers from the wall, with commas, instead of the number, first height and growth"},
    LayerOption{"rows",
                &LayerOptions::rows,
                {.least = 1, .most = 1000},
                "1 to 1000",
                "How many rows of cells above the wall are split"},
    LayerOption{"spacing",
                choice_of<LayerOptions, LayerSpacing, &LayerOptions::spacing>(kLayerSpacing),
                {},
                {},
                "How nodes are spaced across the new layers: graded as the layers grow, or even",
                {},
                "layer_spacing"},
    LayerOption{"grow", &LayerOptions::grow, kNotNegative, "a length, or 0 if the walls have thick cells",
                "First grow a row of thick cells on the walls, of this thickness in the mesh's unit of length"},
    LayerOption{
        "simplices", &LayerOptions::simplices, {}, {}, "Cut all elements of the result into triangles or tetrahedra"},
};

// The options that only matter on the way to the energy's optimum.
constexpr Words kOfEnergy[] = {"energy", "strain", "volumetric", "winslow",  "constants", "mu",    "lambda",
                               "kappa",  "method", "tolerance",  "until_js", "p_norm",    "target"};

template <class... Cases>
struct Overloaded : Cases... {
  using Cases::operator()...;
};
template <class... Cases>
Overloaded(Cases...) -> Overloaded<Cases...>;

}  // namespace

bool OptionRange::contains(double value) const {
  return std::isfinite(value) && (without_least ? value > least : value >= least) &&
         (without_most ? value < most : value <= most);
}

std::span<const OptionInfo> option_table() { return kTable; }
std::span<const GeometryOption> geometry_option_table() { return kGeometryTable; }
std::span<const LayerOption> layer_option_table() { return kLayerTable; }

bool is_of_energy(const OptionInfo& option) { return std::ranges::find(kOfEnergy, option.name) != std::end(kOfEnergy); }

bool is_default(const OptionInfo& option, const Options& options) {
  const Options usual;
  return std::visit(Overloaded{[&](double Options::*member) { return options.*member == usual.*member; },
                               [&](int Options::*member) { return options.*member == usual.*member; },
                               [&](const ChoiceMember& member) { return member.get(options) == member.get(usual); },
                               [](const auto&) { return false; }},
                    option.member);
}

template <class Of>
bool is_number(const OptionOf<Of>& option) {
  return std::holds_alternative<double Of::*>(option.member) || std::holds_alternative<int Of::*>(option.member);
}

std::string number_text(double value) {
  char digits[32];
  std::string text(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
  const std::size_t exponent = text.find("e-0");  // to_chars pads the exponent to two digits
  return exponent == std::string::npos ? text : text.erase(exponent + 2, 1);
}

template <class Of>
std::string default_text(const OptionOf<Of>& option) {
  const Of options;
  if (!option.opposite.empty()) return {};
  return std::visit(Overloaded{[&](double Of::*member) { return number_text(options.*member); },
                               [&](int Of::*member) { return std::to_string(options.*member); },
                               [&](bool Of::*member) { return std::string(options.*member ? "on" : "off"); },
                               [&](const ChoiceOf<Of>& member) {
                                 return std::string(member.words[static_cast<std::size_t>(member.get(options))]);
                               },
                               [](const auto&) { return std::string(); }},
                    option.member);
}

template <class Of>
double number_of(const OptionOf<Of>& option, const Of& options) {
  return std::visit(Overloaded{[&](double Of::*member) { return options.*member; },
                               [&](int Of::*member) { return static_cast<double>(options.*member); },
                               [](const auto&) { return std::numeric_limits<double>::quiet_NaN(); }},
                    option.member);
}

template bool is_number(const OptionInfo&);
template bool is_number(const GeometryOption&);
template bool is_number(const LayerOption&);
template std::string default_text(const OptionInfo&);
template std::string default_text(const GeometryOption&);
template std::string default_text(const LayerOption&);
template double number_of(const OptionInfo&, const Options&);
template double number_of(const GeometryOption&, const GeometryOptions&);
template double number_of(const LayerOption&, const LayerOptions&);

}  // namespace varimesh
