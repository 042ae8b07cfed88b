#pragma once

#include "serve/clients/messages.h"
#include "serve/scene_view.h"

namespace traceflow::serve {

// The camera of a Look's picture, in the scene's units, its sides divided by `divisor`. A photograph's camera
// keeps its shape: the picture is as large as fits into the Look's size. Throws InputError when there is no
// such photograph.
Camera<float> camera_of(const Look& look, const SceneInfo& info, const SceneNormalisation& normalisation,
                        double divisor = 1);

// The same camera with another number of pixels.
Camera<float> resized(Camera<float> camera, int width, int height);

// A captured camera. Throws InputError when there is none.
const CapturedCamera& captured(const PhotoRef& photo, const SceneInfo& info);

}  // namespace traceflow::serve
