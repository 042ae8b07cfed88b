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

// How bodies are drawn for the tracker: one sample a pixel, with a low-pass as wide as the samples that they
// are trained with.
raster::Options raster_for_tracking(const RenderOptions& render, float extent);

// Finds where rigid bodies are at a time of the film: Gauss–Newton on six numbers a body, from what does not
// depend on how their surface reflects: that they cover what the masks cover, and that their normals are
// those of the capture's priors; and from colour and tracked points where they are trusted. The priors'
// error, which estimators share over a picture, is turned away by one rotation a view, from what stands
// still. Works on the CPU, on pictures of at most 160 pixels' width (320 for distance_ratios).
class Tracker {
 public:
  Tracker(const TrackOptions& options, const RenderOptions& render, const Capture& capture);

  // Puts key k where bodies that go on as in the three keys before would be, and the keys behind it there
  // too.
  static void predict(Motion& motion, int64_t key);
  // Predicts and finds the poses of a new key, and learns whether colour and tracks are to be trusted. A body
  // that is lost is looked for elsewhere (track/redetection.h). main, motion: on the CPU.
  void follow(const Surfels& main, Motion& motion, int64_t key, float extent, TextureTrust& trust) const;
  // Finds the poses of a key from where they are. At the first key, where one camera sees it, bodies stay as
  // far from that camera as the points are. nodes: null where bodies are rigid.
  void solve(const Surfels& main, const Nodes* nodes, Motion& motion, int64_t key, float extent,
             const PoseSteps& steps, const TextureTrust& trust) const;
  // How many times as far from the camera each rigid body would be at the first key if its distance were
  // solved there as at other keys: how much larger than the first picture shows it all others have made it.
  // What lies within 0.4 % is not known, and not counted.
  std::vector<double> distance_ratios(const Surfels& main, const Motion& motion, float extent,
                                      const PoseSteps& steps, const TextureTrust& trust) const;

  // How many times as far from the first key's camera as they are drawn bodies are by the capture's points
  // (track/point_distance.h).
  std::vector<double> distances_by_points(const Surfels& main, const Motion& motion, float extent) const;

  // Photometric bundle adjustment (track/photometric_adjustment.h) of each of some bodies over all keys, on
  // photographs from coarse to fine: as if it were rigid, and as its nodes bend it. To one camera what grows
  // looks like what comes closer: of the two, bodies that bend then do what leaves the most of them in place
  // (track/rescale.h).
  struct Adjusted {
    int32_t body = 0;
    double as_rigid = 0, as_bent = 0;  // what remains: the mean cost of a point
    Motion motion;                     // as bent, like the nodes
    Nodes nodes;
  };
  std::vector<Adjusted> adjust(const Surfels& main, const std::vector<int32_t>& bodies, const Motion& motion,
                               const Nodes& nodes, float extent) const;

  // Makes bodies of parts of bodies (track/body_parts.h) that move by themselves: with poses of their own the
  // keys from 1 to `key` cost clearly less. Those poses are found anew. Returns how many bodies have been
  // added.
  int64_t part_bodies(Surfels& main, int64_t points, Motion& motion, int64_t key, float extent) const;

  // Surfels for surface that comes into view at a key, at most `limit` (track/new_surface.h).
  Surfels new_surface(const Surfels& main, Motion& motion, int64_t key, float extent, float tint,
                      int64_t limit) const;

 private:
  // The keys from 1 to another followed again from where the motion stands at key 0.
  struct Refollowed {
    Motion motion;
    double cost = 0;    // of all of them
    double pixels = 0;  // that a body shows, in all of them
  };
  Refollowed follow_again(const Surfels& main, Motion motion, int64_t key, int64_t body, float extent) const;
  // Pictures that are wider are shrunk.
  static constexpr int usual_width = 160;
  TrackTarget target_of(const View& view, int widest) const;
  PoseSolver solver(const Surfels& main, const Nodes* nodes, Motion& motion, int64_t key, float extent,
                    int widest = usual_width) const;
  // Tells the solver which turns are loose, where photographs decide turns; returns them.
  LooseTurns loosen(PoseSolver& solver, const Motion& motion, const TextureTrust& trust) const;
  TrackWeights weights(const Motion& motion, const TextureTrust& trust, const LooseTurns& loose) const;
  bool has_tracks() const { return !capture_.tracks.empty() && options_.tracks > 0; }
  // An earlier key, and what a view of it shows of the bodies.
  struct EarlierView {
    int64_t keys_back;
    size_t view;  // index of the training view
    BodySurface surface;
  };
  // The nearest first: one of each key, or all where tracks are to be compared.
  std::vector<EarlierView> earlier_views(const Surfels& main, const Motion& motion, int64_t key,
                                         float extent) const;
  // Lets the solver compare the key's photograph with earlier ones, where photographs decide turns.
  void compare_photographs(PoseSolver& solver, const std::vector<EarlierView>& earlier, const Motion& motion,
                           int64_t key, const LooseTurns& loose) const;
  // Seeks loose turns that went astray (track/turn_search.h) in the photograph of nine keys before, and turns
  // the keys between by their share. Returns whether any was found.
  bool seek_turns(const std::vector<EarlierView>& earlier, Motion& motion, int64_t key,
                  const LooseTurns& loose) const;
  // Whether what photographs decided is how a mirror image turns.
  void look_for_mirror_images(const std::vector<EarlierView>& earlier, const Motion& motion, int64_t key,
                              const LooseTurns& loose, TextureTrust& trust) const;
  void compare_tracks(PoseSolver& solver, const std::vector<EarlierView>& earlier, const Motion& motion,
                      int64_t key) const;
  // The views as adjustment compares them, photographs at most `widest` wide, less what is finer than `blur`
  // pixels. normals: priors of each training view, empty where there is none.
  FilmViews film_views(const Motion& motion, int64_t widest, double blur,
                       const std::vector<DetailPhoto>& normals) const;
  // The priors as they agree with what stands still, at the size for tracking.
  std::vector<DetailPhoto> film_normals(const Surfels& main, const Motion& motion, float extent) const;
  std::vector<size_t> views_at(const Motion& motion, int64_t key) const;
  // Of the pictures that are drawn of a view.
  static Camera<float> drawn_camera(const View& view, int widest = usual_width);

  TrackOptions options_;
  RenderOptions render_;
  const Capture& capture_;
};

}  // namespace traceflow
