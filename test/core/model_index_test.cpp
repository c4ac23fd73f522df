#include "tabletop_perception/model_index.h"

#include <gtest/gtest.h>

#include "clouds.h"
#include "trained_model.h"

using namespace tabletop_perception;

namespace {

ObjectModel named(const std::string& name) {
  ObjectModel model = trainedModel();
  model.name = name;
  return model;
}

}  // namespace

TEST(ModelIndex, HoldsEveryVectorOfEveryViewWithItsOrigin) {
  const std::vector<ObjectModel> models{named("a"), named("b")};
  const ModelIndex index(models);
  for (const std::string kind : {"vfh", "cvfh"}) {
    const auto& table = index.vectors(kind);
    EXPECT_EQ(table.dimension, VFH_SIZE);
    ASSERT_EQ(table.values.size(), table.entries.size() * VFH_SIZE);
    std::size_t row = 0;
    for (std::size_t m = 0; m < models.size(); ++m)
      for (std::size_t v = 0; v < models[m].views.size(); ++v)
        for (const auto& descriptor : models[m].views[v].descriptors) {
          if (descriptor.kind != kind) continue;
          ASSERT_LT(row, table.entries.size());
          EXPECT_EQ(table.entries[row].model, static_cast<int>(m));
          EXPECT_EQ(table.entries[row].view, static_cast<int>(v));
          EXPECT_EQ(table.entries[row].centroid, descriptor.centroid);
          EXPECT_TRUE(std::equal(descriptor.values.begin(), descriptor.values.end(),
                                 table.values.begin() + row * VFH_SIZE));
          ++row;
        }
    EXPECT_EQ(row, table.entries.size());
    EXPECT_GE(row, 8u);
  }
  EXPECT_TRUE(index.vectors("shot").entries.empty());
}

TEST(ModelIndex, FindsModelsByName) {
  const ModelIndex index({named("a"), named("b")});
  EXPECT_EQ(index.find("a"), 0);
  EXPECT_EQ(index.find("b"), 1);
  EXPECT_EQ(index.find("c"), -1);
  EXPECT_FALSE(index.empty());
  EXPECT_EQ(index.descriptorOptions().leaf, trainedModel().options.leaf);
  const auto& model = index.models()[1];
  EXPECT_EQ(index.grid(1).nearest(model.surface.points[7]) >= 0, true);
}

TEST(ModelIndex, MayBeEmpty) {
  EXPECT_TRUE(ModelIndex().empty());
  EXPECT_TRUE(ModelIndex(std::vector<ObjectModel>{}).empty());
  EXPECT_EQ(ModelIndex().find("a"), -1);
  EXPECT_TRUE(ModelIndex().vectors("vfh").entries.empty());
}

TEST(ModelIndex, RefusesObjectsThatWereDescribedDifferently) {
  auto models = std::vector<ObjectModel>{named("a"), named("b")};
  models[1].options.leaf = 0.006;
  EXPECT_EQ(clouds::refusalOf([&] { ModelIndex{models}; }),
            "objects 'a' and 'b' were trained with different descriptor options; train one of them "
            "again");
}
