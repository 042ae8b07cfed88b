// Bytes as a zip archive, read member by member as a capture would be.
#include <set>

#include "files/file_tree.h"
#include "fuzz/scratch_file.h"

using namespace traceflow;
using fuzz::promise;

namespace {

void read_all_files(const FileTree& tree, const std::string& folder, int depth, size_t archive_bytes) {
  promise(depth < 3000, "a path is short");
  for (const std::string& name : tree.files_in(folder)) {
    const std::string path = folder.empty() ? name : folder + "/" + name;
    promise(!name.empty() && name != ".." && name.find('/') == std::string::npos, "a name is one");
    promise(tree.has(path), "what is listed is there");
    fuzz::accepts(tree.path().string(), [&] {
      const InputFile file = tree.open_file(path);
      promise(file.size() <= static_cast<int64_t>(1040 * archive_bytes), "a file is what its bytes can hold");
      std::vector<std::byte> bytes(static_cast<size_t>(file.size()));
      file.read_at(0, bytes);
    });
  }
  for (const std::string& name : tree.folders_in(folder)) {
    const std::string path = folder.empty() ? name : folder + "/" + name;
    promise(tree.has_folder(path), "what is listed is there");
    read_all_files(tree, path, depth + 1, archive_bytes);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::ScratchFolder folder;
  const auto path = folder.write("a.zip", fuzz::text_of(data, size));
  std::shared_ptr<const FileTree> tree;
  if (fuzz::accepts(path.string(), [&] {
        std::shared_ptr<const FileTree> opened = FileTree::open(path);
        read_all_files(*opened, "", 0, size);
      })) {
    tree = FileTree::open(path);
    promise(!tree->has("../a.zip") && !tree->has("/etc/passwd"), "no path leads out");
  }
  promise(folder.files() == 1, "nothing is left behind");
  return 0;
}
