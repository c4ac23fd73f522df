#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "scene_source.h"
#include "tabletop_perception/model_index.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception::tools {

/// Times of several runs of one thing.
struct Timing {
  double min_ms = 0, median_ms = 0;
  int runs = 0;
};

/// A stage of ours and of stock PCL on the same scene.
struct StageTiming {
  std::string name;
  std::string stock;  ///< the class of PCL's
  Timing ours, pcl;
  std::optional<Timing> rebuilt;  ///< PCL compiled for this processor, where there is such a one

  double ratio() const { return pcl.min_ms / ours.min_ms; }  ///< how many times faster ours is
};

/// How good normals are.
struct NormalsQuality {
  double valid_share = 0;       ///< of the points that have a normal, 0 to 1
  double median_error_deg = 0;  ///< of the angles to the table's normal, on it [deg]
  double p95_error_deg = 0;     ///< 95th percentile of the same [deg]
};

/// A way to normals of ours, and PCL's of the same name.
struct NormalsTiming {
  std::string method;
  Timing ours;
  NormalsQuality our_quality;
  std::optional<Timing> pcl;  ///< none for "window"
  std::optional<NormalsQuality> pcl_quality;
};

/// What `tabletop benchmark` measures on one scene.
struct SceneTiming {
  std::string scene;
  std::vector<StageTiming> stages;
  std::optional<NormalsQuality> our_normals, pcl_normals;
  std::vector<NormalsTiming> normals_methods;  ///< with a grid and a table
  std::optional<Timing> table;  ///< with its outline and points: stock PCL has nothing like it
  std::optional<Timing> split;  ///< cutting clusters apart: stock PCL has nothing like it
  std::optional<Timing> recognition;  ///< cloud to named poses, with a database
  std::string reason;                 ///< why stages are missing; empty: none is
  std::optional<double> frame_mb;     ///< working memory of one frame, bytes to labels [1e6 bytes]
  double process_peak_mb = 0;         ///< of this program with the scene, PCL included [1e6 bytes]
};

/// A function whose result is thrown away at the end of the run, within its time.
template <typename Function>
std::function<void()> discarding(Function function) {
  return [function] {
    const auto result = function();
    asm volatile("" : : "r"(&result) : "memory");  // the work cannot be left out
  };
}

/// How long some work takes [ms].
double millisecondsOf(const std::function<void()>& work);

/// Of times of at least one run.
Timing timingOf(std::vector<double> times_ms);

/// Runs `ours`, `stock` and, if there is one, `rebuilt` in turn, at least `runs` times each; the
/// latter two 5 times at most where one run of `stock` takes over 0.3 s.
StageTiming timeInTurn(const std::string& name, const std::string& stock_name, int runs,
                       const std::function<void()>& ours, const std::function<void()>& stock,
                       const std::function<void()>& rebuilt = {});

/// Times every stage on one scene, on one thread. `models`: null for no recognition.
SceneTiming benchmarkScene(const Scene& scene, const std::optional<Eigen::Vector3d>& up,
                           const PipelineOptions& options, const ModelIndex* models, int runs);

}  // namespace tabletop_perception::tools
