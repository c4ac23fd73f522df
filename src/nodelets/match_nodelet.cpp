#include <optional>
#include <string>

#include <boost/make_shared.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "conversions.h"
#include "model_source.h"
#include "stage_nodelet.h"
#include "tabletop_perception/MatchConfig.h"
#include "tabletop_perception/match.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception {

/// `~input` PointCloud2 with labels -> `~candidates` CandidateArray, what each cluster may be, and
/// `~clusters`, the cloud that they speak of.
///
/// Parameter: `database`, the file with the objects; it is read again whenever it changes.
class MatchNodelet : public StageNodelet {
  void start() override {
    models_.emplace(parameter("database", std::string("~/.ros/tabletop.db")));
    serveOptions<MatchConfig>(getPrivateNodeHandle(), options_);
    candidates_pub_ = advertise<CandidateArray>("candidates");
    clusters_pub_ = advertise<sensor_msgs::PointCloud2>("clusters");
  }

  void subscribe() override {
    input_sub_ =
        getPrivateNodeHandle().subscribe("input", INNER_QUEUE, &MatchNodelet::onClusters, this);
  }

  void unsubscribe() override { input_sub_.shutdown(); }

  void onClusters(const sensor_msgs::PointCloud2ConstPtr& message) {
    attempt([&] {
      const Cloud cloud = cloudFromMessage(*message);
      const auto clusters = clustersOf(labelsFromMessage(*message));
      const ModelIndex& index = models_->update();

      auto candidates = boost::make_shared<CandidateArray>();
      candidates->header = message->header;
      candidates->reason = models_->reason();
      if (!candidates->reason.empty()) warn(candidates->reason);
      for (const auto& proposal : proposeObjects(cloud, clusters, index, options_))
        candidates->clusters.push_back(messageFromProposal(proposal));
      candidates_pub_.publish(candidates);
      clusters_pub_.publish(message);
    });
  }

  MatchOptions options_;
  std::optional<ModelSource> models_;
  ros::Publisher candidates_pub_, clusters_pub_;
  ros::Subscriber input_sub_;
};

}  // namespace tabletop_perception

PLUGINLIB_EXPORT_CLASS(tabletop_perception::MatchNodelet, nodelet::Nodelet)
