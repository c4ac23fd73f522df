#include <pluginlib/class_list_macros.hpp>

#include "conversions.h"
#include "stage_nodelet.h"
#include "tabletop_perception/ClusterConfig.h"
#include "tabletop_perception/SplitConfig.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception {

/// `~input` PointCloud2 of what stands on the table -> `~clusters`, the same cloud with a `label`
/// field: 0 for nothing, 2 and up for one thing each. The options of split live in the namespace
/// `split` beside this one.
class ClusterNodelet : public StageNodelet {
  void start() override {
    serveOptions<ClusterConfig>(getPrivateNodeHandle(), options_.cluster);
    serveOptions<SplitConfig>(ros::NodeHandle(getNodeHandle(), "split"), options_.split);
    clusters_pub_ = advertise<sensor_msgs::PointCloud2>("clusters");
  }

  void subscribe() override {
    input_sub_ =
        getPrivateNodeHandle().subscribe("input", INNER_QUEUE, &ClusterNodelet::onCloud, this);
  }

  void unsubscribe() override { input_sub_.shutdown(); }

  void onCloud(const sensor_msgs::PointCloud2ConstPtr& message) {
    attempt([&] {
      const Cloud cloud = cloudFromMessage(*message);
      const auto clusters =
          splitClusters(cloud, extractClusters(cloud, options_.cluster), options_.split);
      const auto labels = labelsOf(cloud.size(), {}, clusters);
      clusters_pub_.publish(messageFromCloud(cloud, message->header, &labels));
    });
  }

  PipelineOptions options_;  ///< cluster and split count
  ros::Publisher clusters_pub_;
  ros::Subscriber input_sub_;
};

}  // namespace tabletop_perception

PLUGINLIB_EXPORT_CLASS(tabletop_perception::ClusterNodelet, nodelet::Nodelet)
