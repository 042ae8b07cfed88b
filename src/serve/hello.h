#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "serve/clients/messages.h"
#include "serve/scene_view.h"

namespace traceflow::serve {

// The first message to a page: the scene, its cameras and its layers (web/src/messages.ts, Hello).
std::string hello_text(const SceneView& view, const SceneInfo& info);

// {"position": …, "rotation": rows of world_from_camera, "fov_y": …}.
nlohmann::ordered_json to_json(const Viewpoint& camera);
nlohmann::ordered_json to_json(const Vec3<double>& v);

}  // namespace traceflow::serve
