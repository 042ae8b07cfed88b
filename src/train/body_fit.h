#pragma once

#include <optional>
#include <vector>

#include "capture/capture.h"
#include "render/renderer.h"
#include "track/bodies.h"

// Measures, by renders of some training views, how well a scene's bodies fit the photographs. Fields and
// reflections are left out.
namespace traceflow {

// The silhouette errors of the bodies in the views with masks, as a share of the mask's area, in the order of
// time.
std::vector<double> silhouette_errors(const Capture& capture, const Scene& scene, Renderer& renderer);

// The colour error relative to that with the motion `at_rest`. Both count where bodies are visible in either
// state. The scene is as before on return; if this throws, its motion may be `at_rest`.
double relative_colour_error(const Capture& capture, const Motion& at_rest, int sh_degree, Scene& scene,
                             Renderer& renderer);

// The bias of the normal priors in masks (track/prior_bias.h); nothing if it cannot be measured.
std::optional<Mat3<double>> measured_prior_bias(const Capture& capture, const Scene& scene,
                                                Renderer& renderer);

// The differences outside bodies.
Unrest measured_unrest(const Capture& capture, const Scene& scene, int sh_degree, Renderer& renderer);

}  // namespace traceflow
