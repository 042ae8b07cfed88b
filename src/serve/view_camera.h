#pragma once

#include "serve/clients/messages.h"
#include "serve/scene_view.h"

namespace traceflow::serve {

// The camera of a ViewRequest's picture, in the scene's units, with width and height divided by `divisor`. A
// photograph's camera keeps its proportions: the picture is the largest that fits the requested size. Throws
// InputError if there is no such photograph.
Camera<float> camera_of(const ViewRequest& request, const SceneInfo& info,
                        const SceneNormalisation& normalisation, double divisor = 1);

// The same camera with another image size.
Camera<float> resized(Camera<float> camera, int width, int height);

// A captured camera. Throws InputError if there is none.
const CapturedCamera& captured(const PhotoRef& photo, const SceneInfo& info);

}  // namespace traceflow::serve
