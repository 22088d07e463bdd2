// The quadratic form against the loss of accuracy, and its derivatives against differences.
#include "core/solvers/descent/form/modal_form.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/quality/accuracy/team_accuracy.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

class ModalFormOf : public ::testing::TestWithParam<Filling> {
 protected:
  void make(int order) { make(order, team_); }
  /// `team` must outlive the form.
  void make(int order, const Team& team) {
    mesh_ = testing::grid(GetParam(), {2, 2, 2}, order, testing::bent(testing::is_plane(GetParam()) ? 2 : 3));
    testing::shake(mesh_, 0.03, 5);
    problem_ = testing::make_problem(mesh_);
    space_ = own_space(problem_, team);
    team.run([&] { form_.emplace(problem_, space_, local_wave(mesh_), team); });
  }
  double value() {
    std::vector<double> gradient(problem_.free.size() * problem_.dimension);
    return form_->gradient(gradient);
  }
  void move(const std::vector<double>& direction, double amount) {
    const std::size_t d = problem_.dimension;
    for (std::size_t f = 0; f < problem_.free.size(); ++f)
      for (std::size_t k = 0; k < d; ++k) problem_.positions[problem_.free[f] * d + k] += amount * direction[f * d + k];
  }

  const Team team_{1};
  HighOrderMesh mesh_;
  Problem problem_;
  OrderSpace space_;
  std::optional<ModalForm> form_;
};

INSTANTIATE_TEST_SUITE_P(Fillings, ModalFormOf, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& filling) { return std::string(testing::name(filling.param)); });

TEST_P(ModalFormOf, IsTheSquaredLossOfTheMeshThatItWasMadeOf) {
  for (int order = 2; order <= 4; ++order) {
    make(order);
    const double loss = local_loss(mesh_, mesh_.coordinates, team_);
    EXPECT_NEAR(value(), loss * loss, 1e-10 * loss * loss) << "order " << order;
  }
}

TEST_P(ModalFormOf, WithFramesTakenAnewIsTheSquaredLossOfTheMeshAsItIsThen) {
  make(3);
  move(testing::random_direction(problem_, 3), 1);
  const double with_old_frames = value();
  team_.run([&] { form_->take_frames(); });
  const double anew = value();
  EXPECT_NE(anew, with_old_frames);
  team_.run([&] { form_.emplace(problem_, space_, local_wave(mesh_), team_); });
  EXPECT_EQ(value(), anew);
}

TEST_P(ModalFormOf, IsTheSameInTheRoomOfAnother) {
  make(3);
  const std::vector<double> direction = testing::random_direction(problem_, 3);
  std::vector<double> gradient(direction.size()), product(direction.size()), other(direction.size());
  const double own = form_->gradient(gradient);
  form_->multiply(direction, product);
  const std::size_t needed = form_->room().size();
  for (const std::size_t size : {needed - 1, needed, needed + 5}) {
    std::vector<double> room(size, std::nan(""));
    team_.run([&] { form_.emplace(problem_, space_, local_wave(mesh_), team_, room); });
    EXPECT_EQ(form_->room().data() == room.data(), size >= needed);
    EXPECT_EQ(form_->gradient(other), own);
    EXPECT_EQ(other, gradient);
    std::ranges::fill(form_->room(), std::nan(""));
    form_->multiply(direction, other);
    EXPECT_EQ(other, product);
  }
}

TEST_P(ModalFormOf, HasItsDerivatives) {
  make(3);
  const std::vector<double> direction = testing::random_direction(problem_, 3);
  std::vector<double> gradient(direction.size()), after(direction.size());
  const double at_start = form_->gradient(gradient);
  double slope = 0, curvature = 0;
  move(direction, 1);
  const double ahead = form_->gradient(after);
  move(direction, -2);
  const double behind = value();
  for (std::size_t i = 0; i < direction.size(); ++i) {
    slope += gradient[i] * direction[i];
    curvature += (after[i] - gradient[i]) * direction[i];
  }
  // The form is quadratic, so differences are exact but for rounding.
  EXPECT_NEAR(slope, (ahead - behind) / 2, 1e-9 * std::abs(ahead));
  EXPECT_NEAR(curvature, ahead - 2 * at_start + behind, 1e-9 * std::abs(ahead));
}

TEST_P(ModalFormOf, HasProductsOfItsSecondDerivative) {
  make(3);
  const std::vector<double> direction = testing::random_direction(problem_, 3);
  std::vector<double> before(direction.size()), after(direction.size()), product(direction.size());
  form_->gradient(before);
  form_->multiply(direction, product);
  move(direction, 1);
  form_->gradient(after);
  for (std::size_t i = 0; i < direction.size(); ++i)
    EXPECT_NEAR(product[i], after[i] - before[i], 1e-10 * std::abs(after[i]) + 1e-14) << "unknown " << i;
}

TEST_P(ModalFormOf, HasTheDiagonalOfItsSecondDerivative) {
  make(3);
  const OrderSpace* spaces[] = {&space_};
  // diagonals() takes the spaces of all orders from 1 up.
  std::vector<OrderSpace> lower;
  for (int order = 1; order < 3; ++order) lower.push_back(lower_space(problem_, order, team_));
  const std::vector<const OrderSpace*> all{&lower[0], &lower[1], spaces[0]};
  const std::vector<double> none(static_cast<std::size_t>(problem_.cells), 0.0);
  const auto diagonals = form_->diagonals(all, none);
  ASSERT_EQ(diagonals.size(), 3U);
  for (const double entry : diagonals[0]) EXPECT_NEAR(entry, 0, 1e-12);
  const double at_start = value();
  for (std::size_t f = 0; f < problem_.free.size(); f += 7) {
    std::vector<double> unit(problem_.free.size() * problem_.dimension, 0.0);
    unit[f * static_cast<std::size_t>(problem_.dimension)] = 0.1;
    move(unit, 1);
    const double ahead = value();
    move(unit, -2);
    const double behind = value();
    move(unit, 1);
    const double second = (ahead - 2 * at_start + behind) / 0.01;
    EXPECT_NEAR(diagonals[2][f], second, 1e-8 * std::abs(second)) << "node " << f;
  }
}

TEST_P(ModalFormOf, DoesNotDependOnTheNumberOfThreads) {
  make(3);
  std::vector<double> one(problem_.free.size() * problem_.dimension), three(one.size());
  const double with_one = form_->gradient(one);
  const Team team(3);
  make(3, team);
  double with_three = 0;
  team.run([&] { with_three = form_->gradient(three); });
  EXPECT_EQ(with_one, with_three);
  EXPECT_EQ(one, three);
}

}  // namespace
}  // namespace varimesh
