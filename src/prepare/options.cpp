#include "prepare/options.h"

#include <filesystem>

namespace traceflow::prepare {

void PrepareOptions::validate() const {
  constexpr double year = 3.2e7;
  check_option(frames >= 10 && frames <= 10000, "frames", frames, "10 to 10,000");
  check_option(rate >= 0 && rate <= 1000, "rate", rate, "0 to 1000");
  check_option(start >= 0 && start < year, "start", start, "0 or more seconds");
  check_option(end == 0 || (end > start && end < year), "end", end, "0, or more than --start");
  check_option(size >= 64 && size <= 8192, "size", size, "64 to 8192");
  check_option(!masks.empty(), "masks", masks, "estimate, none, or a folder or film of masks");
  check_option(!gives_poses() || std::filesystem::path(poses).extension() == ".npz", "poses", poses,
               "colmap, or an .npz file of MegaSaM");
  check_option(!gives_poses() || test_video.empty(), "test_video", test_video,
               "no second camera with --poses FILE");
  check_option(overlap >= 2 && overlap <= 1000, "overlap", overlap, "2 to 1000");
  check_option(features >= 100 && features <= 100000, "features", features, "100 to 100,000");
  check_option(least_registered > 0 && least_registered <= 1, "least_registered", least_registered,
               "more than 0, at most 1");
  check_option(test_every >= 2 && test_every <= 1000, "test_every", test_every, "2 to 1000");
  check_option(test_offset > -year && test_offset < year, "test_offset", test_offset, "seconds");
  check_option(test_offset == 0 || !test_video.empty(), "test_offset", test_offset, "0 without --test-video");
}

}  // namespace traceflow::prepare
