#include "label_findings.h"

#include <gtest/gtest.h>

namespace tabletop_perception::tools {
namespace {

using Labels = std::vector<std::uint32_t>;

/// So many points of each label, in this order.
Labels runs(const std::vector<std::pair<std::uint32_t, int>>& counts) {
  Labels labels;
  for (const auto& [label, count] : counts) labels.insert(labels.end(), count, label);
  return labels;
}

LabelFindings find(const Labels& truth, const Labels& result) {
  return findObjects(truth, result, scoreLabels(truth, result));
}

TEST(LabelFindings, aRightObjectIsFoundAndHasNothingToSay) {
  const auto findings = find(runs({{1, 500}, {20, 1000}}), runs({{1, 500}, {7, 1000}}));
  ASSERT_EQ(findings.objects.size(), 1u);
  EXPECT_EQ(findings.objects[0].name, "1");
  EXPECT_EQ(findings.objects[0].verdict, "found");
  EXPECT_EQ(findings.objects[0].details, "");
  EXPECT_EQ(findings.object_of_segment.at(7), 0);
  EXPECT_EQ(findings.object_of_point[0], -1);
  EXPECT_EQ(findings.object_of_point[500], 0);
  EXPECT_TRUE(findings.strays.empty());
}

TEST(LabelFindings, anObjectInPiecesIsSplitAndTheLesserPieceStrays) {
  const auto findings = find(runs({{20, 1000}}), runs({{2, 600}, {3, 350}, {1, 30}, {0, 20}}));
  EXPECT_EQ(findings.objects[0].verdict, "split");
  EXPECT_EQ(findings.objects[0].details, "without label 2 %, as table 3 %, in segment 3 35 %");
  ASSERT_EQ(findings.strays.size(), 1u);
  EXPECT_EQ(findings.strays[0].label, 3u);
  EXPECT_EQ(findings.strays[0].details, "object 1 100 %");
}

TEST(LabelFindings, bothObjectsOfOneSegmentAreMerged) {
  const auto findings = find(runs({{20, 1000}, {30, 800}}), runs({{2, 1800}}));
  EXPECT_EQ(findings.objects[0].verdict, "merged");
  EXPECT_EQ(findings.objects[0].details, "of its segment: object 2 44 %");
  EXPECT_EQ(findings.objects[1].verdict, "merged");
  EXPECT_EQ(findings.objects[1].details, "in segment 2 100 %");
}

TEST(LabelFindings, tellsMissedIncompleteAndSpillingObjectsApart) {
  const auto findings = find(runs({{20, 1000}, {30, 1000}, {1, 500}, {40, 1000}}),
                             runs({{0, 1000}, {2, 500}, {1, 500}, {4, 1500}}));
  EXPECT_EQ(findings.objects[0].verdict, "missed");
  EXPECT_EQ(findings.objects[0].details, "without label 100 %");
  EXPECT_EQ(findings.objects[1].verdict, "incomplete");
  EXPECT_EQ(findings.objects[2].verdict, "spills over");
  EXPECT_EQ(findings.objects[2].details, "of its segment: no object 33 %");
}

TEST(LabelFindings, partsAreNamedWhereTheyCountByThemselvesAndSmallOnesAreNoObject) {
  const auto truth = runs({{20, 1000}, {21, 900}, {22, 100}});
  const auto findings = find(truth, runs({{2, 1000}, {3, 900}, {0, 100}}));
  ASSERT_EQ(findings.objects.size(), 2u);
  EXPECT_EQ(findings.objects[0].name, "1.0");
  EXPECT_EQ(findings.objects[1].name, "1.1");
  EXPECT_EQ(findings.object_of_point[1500], 1);
  EXPECT_EQ(findings.object_of_point[1950], -1);
}

}  // namespace
}  // namespace tabletop_perception::tools
