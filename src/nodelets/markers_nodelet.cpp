#include <optional>
#include <string>

#include <message_filters/subscriber.h>
#include <message_filters/sync_policies/exact_time.h>
#include <message_filters/synchronizer.h>
#include <pluginlib/class_list_macros.hpp>

#include "cloud_message.h"
#include "conversions.h"
#include "marker_messages.h"
#include "model_source.h"
#include "stage_nodelet.h"
#include "tabletop_perception/MarkersConfig.h"

namespace tabletop_perception {

/// `~objects` RecognizedObjectArray, `~tables` TableArray and `~clusters` PointCloud2 with labels
/// of one frame -> `~markers` MarkerArray (hull, names, boxes), `~things` PointCloud2 of the
/// clusters in colours, `~models` PointCloud2 of the models at their poses.
///
/// Parameter: `database`, the file with the objects.
class MarkersNodelet : public StageNodelet {
  void start() override {
    models_.emplace(parameter("database", std::string("~/.ros/tabletop.db")));
    serveOptions<MarkersConfig>(getPrivateNodeHandle(), options_);
    sync_.registerCallback(&MarkersNodelet::onFrame, this);
    markers_pub_ = advertise<visualization_msgs::MarkerArray>("markers");
    things_pub_ = advertise<sensor_msgs::PointCloud2>("things");
    models_pub_ = advertise<sensor_msgs::PointCloud2>("models");
  }

  void subscribe() override {
    auto& nh = getPrivateNodeHandle();
    clusters_sub_.subscribe(nh, "clusters", SYNC_QUEUE);
    tables_sub_.subscribe(nh, "tables", SYNC_QUEUE);
    objects_sub_.subscribe(nh, "objects", SYNC_QUEUE);
  }

  void unsubscribe() override {
    clusters_sub_.unsubscribe();
    tables_sub_.unsubscribe();
    objects_sub_.unsubscribe();
  }

  void onFrame(const RecognizedObjectArrayConstPtr& objects, const TableArrayConstPtr& tables,
               const CloudMessageConstPtr& clusters) {
    attempt([&] {
      const Cloud things = coloredThings(clusters->cloud(), clusters->labels(), *objects);
      const Cloud models = modelsAtPoses(*objects, models_->update());
      markers_pub_.publish(sceneMarkers(*objects, *tables, options_));
      things_pub_.publish(messageFromCloud(things, objects->header));
      models_pub_.publish(messageFromCloud(models, objects->header));
    });
  }

  using Policy =
      message_filters::sync_policies::ExactTime<RecognizedObjectArray, TableArray, CloudMessage>;

  MarkerOptions options_;
  std::optional<ModelSource> models_;
  ros::Publisher markers_pub_, things_pub_, models_pub_;
  message_filters::Subscriber<RecognizedObjectArray> objects_sub_;
  message_filters::Subscriber<TableArray> tables_sub_;
  message_filters::Subscriber<CloudMessage> clusters_sub_;
  message_filters::Synchronizer<Policy> sync_{Policy(SYNC_QUEUE), objects_sub_, tables_sub_,
                                              clusters_sub_};
};

}  // namespace tabletop_perception

PLUGINLIB_EXPORT_CLASS(tabletop_perception::MarkersNodelet, nodelet::Nodelet)
