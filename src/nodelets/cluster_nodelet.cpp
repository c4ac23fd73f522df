#include <boost/make_shared.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "cloud_message.h"
#include "conversions.h"
#include "stage_nodelet.h"
#include "tabletop_perception/ClusterConfig.h"
#include "tabletop_perception/ColorConfig.h"
#include "tabletop_perception/SplitConfig.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception {

/// `~input` PointCloud2 of what stands on the table -> `~clusters`, the same cloud with a `label`
/// field: 0 for nothing, 2 and up for one thing each. The options of split and color
/// live in the namespaces `split` and `color` beside this one.
class ClusterNodelet : public StageNodelet {
  void start() override {
    serveOptions<ClusterConfig>(getPrivateNodeHandle(), options_.cluster);
    serveOptions<SplitConfig>(ros::NodeHandle(getNodeHandle(), "split"), options_.split);
    serveOptions<ColorConfig>(ros::NodeHandle(getNodeHandle(), "color"), options_.color);
    clusters_pub_ = advertise<CloudMessage>("clusters");
  }

  void subscribe() override {
    input_sub_ =
        getPrivateNodeHandle().subscribe("input", INNER_QUEUE, &ClusterNodelet::onCloud, this);
  }

  void unsubscribe() override { input_sub_.shutdown(); }

  void onCloud(const CloudMessageConstPtr& message) {
    attempt([&] {
      const auto [cloud, standing] = message->points();
      const auto parts =
          splitClusters(cloud, extractClusters(cloud, standing, options_.cluster), options_.split);
      const auto clusters = colorCorrected(cloud, parts, options_.color);
      clusters_pub_.publish(
          boost::make_shared<CloudMessage>(*message, labelsOf(cloud.size(), {}, clusters)));
    });
  }

  PipelineOptions options_;  ///< cluster, split and color count
  ros::Publisher clusters_pub_;
  ros::Subscriber input_sub_;
};

}  // namespace tabletop_perception

PLUGINLIB_EXPORT_CLASS(tabletop_perception::ClusterNodelet, nodelet::Nodelet)
