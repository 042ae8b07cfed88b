#pragma once

#include <vector>

#include "capture/capture.h"
#include "render/render_options.h"
#include "scene/scene.h"
#include "track/new_surface.h"
#include "track/options.h"
#include "track/photometric_adjustment.h"
#include "track/pose_solver.h"
#include "track/texture_trust.h"

namespace traceflow {

// How the tracker renders bodies: one sample per pixel, with a low-pass as wide as the samples in training.
raster::Options raster_for_tracking(const RenderOptions& render, float extent);

// Finds the poses of rigid bodies at a key, by Gauss–Newton on six numbers per body. The residuals do not
// depend on how surfaces reflect: silhouettes against masks, and normals against the capture's priors. Colour
// and tracked points are added where they are trusted. One rotation per view, from static surfaces, corrects
// the error that an estimator's normals share over an image. On the CPU, with images at most 160 pixels wide
// (320 for distance_ratios).
class Tracker {
 public:
  Tracker(const TrackOptions& options, const RenderOptions& render, const Capture& capture);

  // Sets the poses of `key` and of all later keys by extrapolating the motion of the three keys before.
  static void predict(Motion& motion, int64_t key);
  // Extrapolates and solves the poses of a new key, and updates whether colour and tracks are trusted.
  // Searches for lost bodies (track/redetection.h). main, motion: on the CPU.
  void follow(const Surfels& main, Motion& motion, int64_t key, float extent, TextureTrust& trust) const;
  // Solves the poses of a key from their current values. At the first key, if one camera sees it, bodies keep
  // their distance from that camera, which is that of the points. nodes: null if bodies are rigid.
  void solve(const Surfels& main, const Nodes* nodes, Motion& motion, int64_t key, float extent,
             const PoseSteps& steps, const TextureTrust& trust) const;
  // For each rigid body, the ratio by which its distance from the camera would change at the first key if it
  // were solved there as at other keys. This is how much larger the other keys have made the body than the
  // first view shows it. Ratios within 0.4 % of 1 are uncertain and ignored.
  std::vector<double> distance_ratios(const Surfels& main, const Motion& motion, float extent,
                                      const PoseSteps& steps, const TextureTrust& trust) const;

  // For each body, the ratio of the distance of the capture's points from the first key's camera to the
  // rendered distance (track/point_distance.h).
  std::vector<double> distances_by_points(const Surfels& main, const Motion& motion, float extent) const;

  // Photometric bundle adjustment (track/photometric_adjustment.h) of each given body over all keys, on
  // photographs from coarse to fine, rigid and with nodes. To a single camera, growing looks like
  // approaching, so the deformation that leaves the most of the body in place is chosen (track/rescale.h).
  struct Adjusted {
    int32_t body = 0;
    double as_rigid = 0, as_bent = 0;  // the remaining mean cost of a point
    Motion motion;                     // with deformation, like the nodes
    Nodes nodes;
  };
  std::vector<Adjusted> adjust(const Surfels& main, const std::vector<int32_t>& bodies, const Motion& motion,
                               const Nodes& nodes, float extent) const;

  // Turns parts of bodies (track/body_parts.h) into separate bodies if they move separately: if separate
  // poses make the keys from 1 to `key` cost clearly less. These poses are solved anew. Returns the number of
  // added bodies.
  int64_t part_bodies(Surfels& main, int64_t points, Motion& motion, int64_t key, float extent) const;

  // Surfels for surface that becomes visible at a key, at most `limit` (track/new_surface.h).
  Surfels new_surface(const Surfels& main, Motion& motion, int64_t key, float extent, float tint,
                      int64_t limit) const;

 private:
  // The keys from 1 to a given one, tracked again from the motion's state at key 0.
  struct Refollowed {
    Motion motion;
    double cost = 0;    // sum over these keys
    double pixels = 0;  // number that show a body, over these keys
  };
  Refollowed follow_again(const Surfels& main, Motion motion, int64_t key, int64_t body, float extent) const;
  // Wider images are reduced.
  static constexpr int usual_width = 160;
  TrackTarget target_of(const View& view, int widest) const;
  PoseSolver solver(const Surfels& main, const Nodes* nodes, Motion& motion, int64_t key, float extent,
                    int widest = usual_width) const;
  // Gives the solver the loose rotations if photographs may determine them, and returns them.
  LooseTurns loosen(PoseSolver& solver, const Motion& motion, const TextureTrust& trust) const;
  TrackWeights weights(const Motion& motion, const TextureTrust& trust, const LooseTurns& loose) const;
  bool has_tracks() const { return !capture_.tracks.empty() && options_.tracks > 0; }
  // An earlier key, and what one of its views shows of the bodies.
  struct EarlierView {
    int64_t keys_back;
    size_t view;  // index of a training view
    BodySurface surface;
  };
  // The nearest first. One view per key, or all if tracks are used.
  std::vector<EarlierView> earlier_views(const Surfels& main, const Motion& motion, int64_t key,
                                         float extent) const;
  // Makes the solver compare the key's photograph with earlier ones, if photographs determine rotations.
  void compare_photographs(PoseSolver& solver, const std::vector<EarlierView>& earlier, const Motion& motion,
                           int64_t key, const LooseTurns& loose) const;
  // Searches the photograph nine keys before for loose rotations that went wrong (track/turn_search.h), and
  // spreads a correction over the keys between. Returns whether any was found.
  bool seek_turns(const std::vector<EarlierView>& earlier, Motion& motion, int64_t key,
                  const LooseTurns& loose) const;
  // Updates whether the rotations by photographs are those of a mirror image.
  void look_for_mirror_images(const std::vector<EarlierView>& earlier, const Motion& motion, int64_t key,
                              const LooseTurns& loose, TextureTrust& trust) const;
  void compare_tracks(PoseSolver& solver, const std::vector<EarlierView>& earlier, const Motion& motion,
                      int64_t key) const;
  // The views for the adjustment: photographs at most `widest` wide, blurred by `blur` pixels. normals:
  // priors of each training view, empty if it has none.
  FilmViews film_views(const Motion& motion, int64_t widest, double blur,
                       const std::vector<DetailPhoto>& normals) const;
  // The priors at the size for tracking, corrected to agree with static surfaces.
  std::vector<DetailPhoto> film_normals(const Surfels& main, const Motion& motion, float extent) const;
  std::vector<size_t> views_at(const Motion& motion, int64_t key) const;
  // The camera of a view's reduced image.
  static Camera<float> drawn_camera(const View& view, int widest = usual_width);

  TrackOptions options_;
  RenderOptions render_;
  const Capture& capture_;
};

}  // namespace traceflow
