#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "serve/audience/messages.h"
#include "serve/stage.h"

namespace traceflow::serve {

// What a page hears first: what there is to see (web/src/messages.ts, Hello).
std::string hello_text(const Stage& stage, const Setting& setting);

// {"position": …, "rotation": rows of world_from_camera, "fov_y": …}.
nlohmann::ordered_json to_json(const Viewpoint& camera);
nlohmann::ordered_json to_json(const Vec3<double>& v);

}  // namespace traceflow::serve
