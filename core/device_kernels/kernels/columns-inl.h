// The derivatives of a vector at the nodes of a cell, and the transposed operation, by the threads that share the cell.
//
// A basis function is b(ξ) l(η), with b of the base and l of the line along a column (splits.h); on a simplex it is b.
// So at each height η_z the columns' values Σ_l x_l l(η_z) and slopes Σ_l x_l l'(η_z) are computed first, and from
// these, at each point of the base, the derivatives Σ value ∂b/∂ξ_k and, along the columns, Σ slope b.
#if defined(VARIMESH_DEVICE_COLUMNS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_DEVICE_COLUMNS_INL_H
#undef VARIMESH_DEVICE_COLUMNS_INL_H
#else
#define VARIMESH_DEVICE_COLUMNS_INL_H
#endif

#include "core/device_kernels/kernels/arguments.h"
#include "core/device_kernels/kernels/parts-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

using device::CellKind;

/// The columns of one cell. T: double or float. The order of the calls is that of the functions.
template <class T, CellKind kind, int parts>
class Columns {
  static constexpr int d = kind.dimension, kLayers = kind.layers;
  static constexpr int kHereNow = kHere<parts>, kTurnsNow = kTurns<parts>;
  static constexpr bool kLayered = kind.is_layered();

 public:
  /// Columns of a part. The last of the last parts may be missing; then the tables have zeros.
  static constexpr int kColumns = device::columns_of_part(kind, parts);
  /// Numbers of a point of the base in the table.
  static constexpr int kRow = parts * d * kColumns;
  /// Numbers of a height in the table.
  static constexpr int kLine = kLayered ? 2 * kLayers : 0;

  /// Numbers of the whole table: device::CellTables::derivatives.
  static HWY_INLINE int size(const device::CellTables<T>& tables) {
    return device::padded_points(tables.bases, parts) * kRow + tables.heights * kLine;
  }

  /// @param table  tables.derivatives, or a copy
  HWY_INLINE Columns(const device::CellTables<T>& tables, const T* table, int first_part)
      : tables_(tables), table_(table), first_part_(first_part), groups_((tables.bases + parts - 1) / parts) {}

  /// Groups of as many points of the base as there are parts. Each part has one of them, or none in the last group.
  HWY_INLINE int groups() const { return groups_; }
  HWY_INLINE int heights() const { return kLayered ? tables_.heights : 1; }
  /// Whether a part has a point in a group.
  HWY_INLINE bool has_point(int group, int p) const { return group * parts + part(p) < tables_.bases; }
  /// The slot of a part's point; any slot if it has none.
  HWY_INLINE int slot(int height, int group, int p) const {
    const int wanted = group * parts + part(p), base = wanted < tables_.bases ? wanted : tables_.bases - 1;
    return kLayered ? tables_.slots[height * tables_.bases + base] : base;
  }

  /// Before the first height, of a simplex whose vector stays where it is. `load(node, x)`: the vector at a node.
  template <class Load>
  HWY_INLINE void begin(const Load& load) {
    if constexpr (!kLayered)
      for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int c = 0; c < kColumns; ++c) {
          load(node(p, c, 0), value_[p][c]);
        }
  }
  /// Computes values and slopes at a height. The vector is loaded each time: there are no registers to keep it.
  template <class Load>
  HWY_INLINE void raise(int height, const Load& load) {
    if constexpr (kLayered) {
      forget_loads();
      const T* line = line_at(height);
      for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int c = 0; c < kColumns; ++c) {
          VARIMESH_UNROLLED for (int i = 0; i < d; ++i) { value_[p][c][i] = slope_[p][c][i] = 0; }
          VARIMESH_UNROLLED for (int layer = 0; layer < kLayers; ++layer) {
            T x[d];
            load(node(p, c, layer), x);
            VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
              value_[p][c][i] = hn::fused(x[i], line[2 * layer], value_[p][c][i]);
              slope_[p][c][i] = hn::fused(x[i], line[2 * layer + 1], slope_[p][c][i]);
            }
          }
        }
    }
  }

  /// Of each part's own point of a group: ∂x_i/∂ξ_k at i d + k. Of a part without a point: any numbers.
  HWY_INLINE void derive(int group, T (&own)[kHereNow][d * d]) const {
    VARIMESH_NOT_UNROLLED
    for (int round = 0; round < kRounds; ++round) {
      const int first = group * parts + round * kTurnsNow;
      if (kRounds > 1 && first >= tables_.bases) break;
      T sums[kHereNow][kTurnsNow][d * d], theirs[kHereNow][d * d];
      for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int turn = 0; turn < kTurnsNow; ++turn) {
          derive_by_part(first + turn, p, sums[p][turn]);
        }
      take_turns<parts>(sums, first_part_, theirs);
      for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) {
          own[p][i] = round == 0 || part(p) / kTurnsNow == round ? theirs[p][i] : own[p][i];
        }
    }
  }

  // === The transposed operation ===
  /// Before the first height.
  HWY_INLINE void clear() {
    if constexpr (kLayered) {
      for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int i = 0; i < kColumns * kLayers * d; ++i) {
          total_[p][i / (kLayers * d)][i / d % kLayers][i % d] = 0;
        }
    } else {
      begin_height();
    }
  }
  /// Before the first group of a height.
  HWY_INLINE void begin_sums() {
    if constexpr (kLayered) begin_height();
  }
  /// Adds Σ_k own_ik ∂φ/∂ξ_k of the parts' points of a group. Parts without a point have zeros.
  HWY_INLINE void add(int group, const T (&own)[kHereNow][d * d]) {
    VARIMESH_NOT_UNROLLED
    for (int round = 0; round < kRounds; ++round) {
      const int first = group * parts + round * kTurnsNow;
      if (kRounds > 1 && first >= tables_.bases) break;
      VARIMESH_UNROLLED for (int turn = 0; turn < kTurnsNow; ++turn) {
        T theirs[d * d];
        share<parts>(own, round * kTurnsNow + turn, theirs);
        for (int p = 0; p < kHereNow; ++p) add_by_part(first + turn, p, theirs);
      }
    }
  }
  /// After the last group of a height: what the values and slopes have got goes to the nodes.
  HWY_INLINE void lower(int height) {
    if constexpr (kLayered) {
      forget_loads();
      const T* line = line_at(height);
      for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int c = 0; c < kColumns; ++c) {
          VARIMESH_UNROLLED for (int layer = 0; layer < kLayers; ++layer) {
            VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
              T& total = total_[p][c][layer][i];
              total = hn::fused(value_sum_[p][c][i], line[2 * layer], total);
              total = hn::fused(slope_sum_[p][c][i], line[2 * layer + 1], total);
            }
          }
        }
    }
  }
  /// After the last height: calls use(node, sum) for the nodes that are here.
  template <class Use>
  HWY_INLINE void for_nodes(const Use& use) const {
    for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int c = 0; c < kColumns; ++c) {
        if (part(p) * kColumns + c >= kind.columns) continue;
        VARIMESH_UNROLLED for (int layer = 0; layer < kLayers; ++layer) {
          if constexpr (kLayered)
            use(node(p, c, layer), total_[p][c][layer]);
          else
            use(node(p, c, layer), value_sum_[p][c]);
        }
      }
  }

 private:
  /// Rounds of a group: in each, as many of its points as there are turns.
  static constexpr int kRounds = parts / kTurnsNow;
  /// Entries of an array that only cells in layers have.
  static constexpr int kLayeredHere = kLayered ? kHereNow : 1, kLayeredColumns = kLayered ? kColumns : 1;

  HWY_INLINE int part(int p) const { return first_part_ + p; }
  /// The last column stands for those that a part lacks.
  HWY_INLINE int node(int p, int c, int layer) const {
    const int wanted = part(p) * kColumns + c, column = wanted < kind.columns ? wanted : kind.columns - 1;
    return kLayered ? tables_.nodes[column * kLayers + layer] : column;
  }
  HWY_INLINE const T* line_at(int height) const {
    return table_ + device::padded_points(tables_.bases, parts) * kRow + height * kLine;
  }
  HWY_INLINE const T* row(int base, int p) const { return table_ + base * kRow + part(p) * d * kColumns; }
  /// Whether the derivative in direction k is that along the columns.
  static constexpr bool is_along(int k) { return kLayered && k == d - 1; }

  HWY_INLINE void derive_by_part(int base, int p, T (&out)[d * d]) const {
    const T* numbers = row(base, p);
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) { out[i] = 0; }
    VARIMESH_UNROLLED for (int c = 0; c < kColumns; ++c) {
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
        const T number = numbers[k * kColumns + c];
        VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
          const T x = is_along(k) ? slope_[kLayered ? p : 0][kLayered ? c : 0][i] : value_[p][c][i];
          out[i * d + k] = hn::fused(x, number, out[i * d + k]);
        }
      }
    }
  }

  HWY_INLINE void begin_height() {
    for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int c = 0; c < kColumns; ++c) {
        VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
          value_sum_[p][c][i] = 0;
          if constexpr (kLayered) slope_sum_[p][c][i] = 0;
        }
      }
  }

  HWY_INLINE void add_by_part(int base, int p, const T (&theirs)[d * d]) {
    const T* numbers = row(base, p);
    VARIMESH_UNROLLED for (int c = 0; c < kColumns; ++c) {
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
        const T number = numbers[k * kColumns + c];
        VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
          T& sum = is_along(k) ? slope_sum_[kLayered ? p : 0][kLayered ? c : 0][i] : value_sum_[p][c][i];
          sum = hn::fused(theirs[i * d + k], number, sum);
        }
      }
    }
  }

  const device::CellTables<T>& tables_;
  const T* table_;
  const int first_part_;
  const int groups_;
  T value_[kHereNow][kColumns][d];  ///< At a height; of a simplex the vector itself.
  T slope_[kLayeredHere][kLayeredColumns][d];
  T value_sum_[kHereNow][kColumns][d];
  T slope_sum_[kLayeredHere][kLayeredColumns][d];
  T total_[kLayeredHere][kLayeredColumns][kLayers][d];  ///< By node.
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
