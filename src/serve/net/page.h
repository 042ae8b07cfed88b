#pragma once

#include <span>

#include "base/embedded_file.h"

namespace traceflow::serve {

// The viewer's page and its files, from web/page/.
std::span<const EmbeddedFile> embedded_files();

}  // namespace traceflow::serve
