// What a summary says of the objective of a run.
#include "client/io/summary.h"

#include <gtest/gtest.h>

#include <sstream>
#include <string>

namespace varimesh::client {
namespace {

v1::Metrics metrics_of(v1::Objective objective, double loss_before, double loss_after, double mean_after) {
  v1::Metrics metrics;
  metrics.set_objective(objective);
  metrics.mutable_mesh()->set_order(3);
  metrics.mutable_before()->mutable_accuracy()->set_loss(loss_before);
  metrics.mutable_after()->mutable_accuracy()->set_loss(loss_after);
  metrics.mutable_before()->set_min_scaled_jacobian(.25);
  metrics.mutable_after()->set_min_scaled_jacobian(.5);
  metrics.mutable_before()->set_mean_scaled_jacobian(.9);
  metrics.mutable_after()->set_mean_scaled_jacobian(mean_after);
  return metrics;
}

TEST(ObjectiveText, HasTheFigureThatTheObjectiveLooksAt) {
  EXPECT_EQ(objective_text(metrics_of(v1::OBJECTIVE_ACCURACY, .00648, .00579, .9), {}),
            "objective: accuracy; loss of accuracy 0.00648 -> 0.00579, 11 % lower");
  EXPECT_EQ(objective_text(metrics_of(v1::OBJECTIVE_WORST, .1, .1, .9), {}),
            "objective: worst; smallest scaled Jacobian 0.25000 -> 0.50000");
  EXPECT_EQ(objective_text(metrics_of(v1::OBJECTIVE_UNSPECIFIED, .1, .1, .9), {}), "");
}

TEST(ObjectiveText, SaysWhyTheObjectiveIsEnergy) {
  v1::Metrics metrics = metrics_of(v1::OBJECTIVE_ENERGY, .1, .1, .9);
  v1::Options asked;
  asked.set_objective(v1::OBJECTIVE_ENERGY);
  asked.set_tolerance(1e-3);
  EXPECT_EQ(objective_text(metrics, asked), "objective: energy");
  asked.set_objective(v1::OBJECTIVE_AUTO);
  EXPECT_EQ(objective_text(metrics, asked),
            "objective: energy, because --tolerance is given; --objective accuracy lowers the loss of accuracy");
  asked.set_lambda(2);
  EXPECT_NE(objective_text(metrics, asked).find("--lambda, --tolerance are given"), std::string::npos)
      << objective_text(metrics, asked);
  metrics.mutable_mesh()->set_order(1);
  EXPECT_EQ(objective_text(metrics, {}), "objective: energy, because no element of order 1 is curved");
}

TEST(ObjectiveText, SaysWhyAFigureIsWorseThanItWas) {
  EXPECT_EQ(worse_text(metrics_of(v1::OBJECTIVE_ACCURACY, .1, .05, .9)), "");
  EXPECT_EQ(worse_text(metrics_of(v1::OBJECTIVE_ACCURACY, .1, .05, .85)).find("The mean scaled Jacobian fell"), 0U);
  EXPECT_EQ(worse_text(metrics_of(v1::OBJECTIVE_ACCURACY, .1, .2, .85)).find("The loss of accuracy rose"), 0U);
  EXPECT_EQ(worse_text(metrics_of(v1::OBJECTIVE_ENERGY, .1, .1001, .85)), "");
  EXPECT_NE(worse_text(metrics_of(v1::OBJECTIVE_WORST, .1, .2, .95)).find("the objective worst does not"),
            std::string::npos);
}

TEST(DoneText, SaysWhatCouldMoveAndHowTheRunEnded) {
  v1::Metrics metrics;
  metrics.mutable_mesh()->set_nodes(10);
  metrics.mutable_mesh()->set_free_nodes(4);
  metrics.set_iterations(3);
  metrics.set_stop_reason(v1::STOP_REASON_TIME_LIMIT);
  EXPECT_EQ(done_text(metrics),
            "4 of 10 nodes were free to move, and the boundary stayed as it was; 3 iterations, not converged: ended by "
            "the time limit.");
  metrics.mutable_geometry()->set_nodes(5);
  EXPECT_EQ(done_text(metrics).find("After boundary nodes slid, 4 of 10 nodes were free to move; 3"), 0U);
}

TEST(Summary, SaysWhatItsFiguresMeanInEightyColumns) {
  v1::Metrics metrics = metrics_of(v1::OBJECTIVE_ACCURACY, .00648, .00579, .9);
  metrics.mutable_before()->mutable_certified()->set_min_scaled_jacobian_lower_bound(-12345.12345);
  const std::string text = summary(metrics, {});
  for (const char* meaning :
       {"0.00579  of a solver; 0 is best\n", "0.50000  1 is best; 0 or less: invalid\n", "  no element has less\n"})
    EXPECT_NE(text.find(meaning), std::string::npos) << text;
  const std::string table = text.substr(text.find("before"), text.find("no element has less") - text.find("before"));
  std::istringstream lines(table);
  for (std::string line; std::getline(lines, line);) EXPECT_LT(line.size(), 80U) << line;
}

}  // namespace
}  // namespace varimesh::client
