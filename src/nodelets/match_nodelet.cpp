#include <optional>
#include <string>

#include <message_filters/subscriber.h>
#include <message_filters/sync_policies/exact_time.h>
#include <message_filters/synchronizer.h>
#include <boost/make_shared.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "cloud_message.h"
#include "conversions.h"
#include "model_source.h"
#include "stage_nodelet.h"
#include "tabletop_perception/MatchConfig.h"
#include "tabletop_perception/match.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception {

/// `~input` PointCloud2 with labels, `~tables` TableArray and `~cloud`, the filtered PointCloud2 of
/// the whole scene -> `~candidates` CandidateArray, what each cluster may be, and
/// `~clusters`, the cloud that they speak of.
/// Clusters that stay as they are keep their candidates for the time `keep`.
///
/// Parameter: `database`, the file with the objects; it is read again whenever it changes.
class MatchNodelet : public StageNodelet {
  void start() override {
    models_.emplace(parameter("database", std::string("~/.ros/tabletop.db")));
    serveOptions<MatchConfig>(getPrivateNodeHandle(), options_, [this] { memory_.clear(); });
    sync_.registerCallback(&MatchNodelet::onClusters, this);
    // Now, and not with the first frame: who calls a graph that sleeps would wait for it.
    reading_ = getPrivateNodeHandle().createWallTimer(
        ros::WallDuration(0.01), [this](const auto&) { models(); }, true);
    candidates_pub_ = advertise<CandidateArray>("candidates");
    clusters_pub_ = advertise<CloudMessage>("clusters");
  }

  void subscribe() override {
    auto& nh = getPrivateNodeHandle();
    cloud_sub_.subscribe(nh, "cloud", SYNC_QUEUE);
    tables_sub_.subscribe(nh, "tables", SYNC_QUEUE);
    input_sub_.subscribe(nh, "input", SYNC_QUEUE);
  }

  void unsubscribe() override {
    cloud_sub_.unsubscribe();
    tables_sub_.unsubscribe();
    input_sub_.unsubscribe();
  }

  /// What the database holds by now.
  const ModelIndex& models() {
    const ModelIndex& index = models_->update();
    health().setValue("objects known", std::to_string(index.models().size()));
    return index;
  }

  void onClusters(const CloudMessageConstPtr& message, const TableArrayConstPtr& tables,
                  const CloudMessageConstPtr& scene_message) {
    attempt(message->header.stamp, [&] {
      const Cloud& scene = scene_message->cloud();
      const auto clusters = clustersOf(message->labels());
      const int generation = models_->generation();
      const ModelIndex& index = models();
      if (models_->generation() != generation) memory_.clear();

      auto candidates = boost::make_shared<CandidateArray>();
      candidates->header = message->header;
      candidates->reason = models_->reason();
      if (!candidates->reason.empty()) warn(candidates->reason);
      health().setReason(candidates->reason);
      for (const auto& proposal : proposeObjects(scene, clusters, tablesFromMessage(*tables), index,
                                                 options_, message->header.stamp.toSec(), memory_))
        candidates->clusters.push_back(messageFromProposal(proposal));
      candidates_pub_.publish(candidates);
      clusters_pub_.publish(message);
    });
  }

  MatchOptions options_;
  std::optional<ModelSource> models_;
  ProposalMemory memory_;
  ros::Publisher candidates_pub_, clusters_pub_;
  using Policy = message_filters::sync_policies::ExactTime<CloudMessage, TableArray, CloudMessage>;
  message_filters::Subscriber<CloudMessage> input_sub_;
  message_filters::Subscriber<TableArray> tables_sub_;
  message_filters::Subscriber<CloudMessage> cloud_sub_;
  message_filters::Synchronizer<Policy> sync_{Policy(SYNC_QUEUE), input_sub_, tables_sub_,
                                              cloud_sub_};
  ros::WallTimer reading_;  ///< last: when it goes it waits for what it called
};

}  // namespace tabletop_perception

PLUGINLIB_EXPORT_CLASS(tabletop_perception::MatchNodelet, nodelet::Nodelet)
