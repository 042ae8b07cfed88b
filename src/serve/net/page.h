#pragma once

#include <span>

#include "base/embedded_file.h"

namespace traceflow::serve {

// The viewer's page and what belongs to it, from web/page/.
std::span<const EmbeddedFile> embedded_files();

}  // namespace traceflow::serve
