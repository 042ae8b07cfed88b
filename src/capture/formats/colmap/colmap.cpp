#include "capture/formats/colmap/colmap.h"

#include <algorithm>
#include <array>
#include <map>

#include "base/error.h"
#include "capture/formats/colmap/colmap_model.h"
#include "capture/formats/image_names.h"
#include "capture/formats/normalise.h"

namespace traceflow {

namespace {

constexpr std::array<const char*, 3> model_folders = {"sparse/0", "sparse", ""};
constexpr std::array<const char*, 4> image_folders = {"images", "input", "rgb", ""};

std::string model_folder(const FileTree& tree) {
  const auto found =
      std::ranges::find_if(model_folders, [&](const char* folder) { return has_colmap_model(tree, folder); });
  if (found != model_folders.end()) return *found;
  throw InputError(tree.path().string(), "", "no COLMAP model",
                   "cameras and images (.bin or .txt) in sparse/0, sparse or the folder itself");
}

// The folder's name at a lower size. Images at the top have no such folder.
std::string folder_at(const std::string& folder, int stored) {
  return stored == 1 || folder.empty() ? folder : folder + "_" + std::to_string(stored);
}

// Reads step by step into `found_`.
class ColmapReader {
 public:
  ColmapReader(std::shared_ptr<const FileTree> tree, const CaptureOptions& options)
      : tree_(std::move(tree)), options_(options), folder_(model_folder(*tree_)) {
    model_ = read_colmap_model(*tree_, folder_);
    for (ColmapImage& image : model_.images) image.name = tidy_path(image.name);
    std::ranges::sort(model_.images, natural_less, &ColmapImage::name);
    for (const ColmapImage& image : model_.images) names_.push_back(image.name);
  }

  FoundCapture read() {
    found_.format = "colmap";
    found_.times = CaptureTimes::names;
    warn_about_models();
    find_images();
    split();
    for (const ColmapPoint& point : model_.points) found_.points.push_back(point.position);
    if (!found_.points.empty()) found_.points_file = model_.points_file;
    std::vector<FoundView> all = found_.train;
    all.insert(all.end(), found_.test.begin(), found_.test.end());
    found_.normalisation = normalise(all, found_.points);
    return std::move(found_);
  }

 private:
  void warn_about_models() {
    std::vector<std::string> others;
    for (const std::string& name : tree_->folders_in("sparse")) {
      const std::string folder = "sparse/" + name;
      if (folder != folder_ && has_colmap_model(*tree_, folder)) others.push_back(folder);
    }
    if (!others.empty()) {
      found_.warnings.emplace_back("COLMAP made several models that it could not join: " + folder_ +
                                       " is read, " + ids_text(others) + " not",
                                   "several-models");
    }
  }

  // Uses the first folder with any image of the model at a fitting size, or else at any size.
  void find_images() {
    const auto is_stored_in = [&](const std::string& folder) {
      return [&, folder](int stored) { return has_some(folder, stored); };
    };
    const auto* root = std::ranges::find_if(image_folders, [&](const char* folder) {
      return fitting_scale(options_.downscale, is_stored_in(folder)) > 0;
    });
    if (root == image_folders.end()) {
      root = std::ranges::find_if(
          image_folders, [&](const char* folder) { return !stored_scales(is_stored_in(folder)).empty(); });
    }
    if (names_.empty()) {
      throw InputError(tree_->name_of(model_.images_file), "", "no images", "those that COLMAP registered",
                       "run COLMAP's mapper again, or copy the whole model");
    }
    if (root == image_folders.end()) {
      throw InputError(tree_->path().string(), "images",
                       "none of the " + std::to_string(names_.size()) + " photographs that " +
                           model_.images_file + " names",
                       "them in images/", names_.empty() ? "" : "the first is " + names_.front());
    }
    found_.images = choose_images(tree_->name_of(*root), options_.downscale, is_stored_in(*root),
                                  [&](int stored) { return folder_at(*root, stored); });
  }

  bool has_some(const std::string& root, int stored) const {
    const std::string folder = folder_at(root, stored);
    if (stored > 1 && (root.empty() || !tree_->has_folder(folder))) return false;
    return std::ranges::any_of(names_, [&](const std::string& name) {
      return !find_image(*tree_, in_folder(folder, name)).empty();
    });
  }

  std::string path_of(const std::string& name) const {
    return find_image(*tree_, in_folder(found_.images.folder, name));
  }

  void split() {
    found_.all_ids = image_ids(names_, [&](size_t) { return tree_->name_of(model_.images_file); });
    for (const std::string& name : names_)
      found_.listed_images.push_back(without_extension(in_folder(found_.images.folder, name)));
    std::map<std::string, size_t> place;
    for (size_t i = 0; i < names_.size(); ++i) place.emplace(found_.all_ids[i], i);
    const auto exists = [&](const std::string& id) { return !path_of(names_[place.at(id)]).empty(); };
    const auto usual_path = [&](const std::string& id) {
      return in_folder(found_.images.folder, names_[place.at(id)]);
    };
    const auto whole = keep_whole(found_.all_ids, "registered", "image", exists, found_.warnings,
                                  "missing-image", usual_path);
    for (size_t n = 0; n < whole.size(); ++n) {
      const size_t i = place.at(whole[n]);
      const bool is_test = tests(n, options_.test_every);
      (is_test ? found_.test : found_.train).push_back(view_of(model_.images[i], whole[n]));
      if (!is_test) found_.train_ids.push_back(whole[n]);
    }
  }

  FoundView view_of(const ColmapImage& image, const std::string& id) const {
    return {id,
            {tree_, path_of(image.name)},
            model_.camera(image.camera_id)->lens,
            tree_->name_of(model_.cameras_file) + ": camera " + std::to_string(image.camera_id),
            image.camera_from_world,
            image.position,
            0,
            std::filesystem::path(image.name).parent_path().generic_string()};
  }

  const std::shared_ptr<const FileTree> tree_;
  const CaptureOptions options_;
  const std::string folder_;
  ColmapModel model_;
  std::vector<std::string> names_;
  FoundCapture found_;
};

}  // namespace

bool is_colmap(const FileTree& tree) {
  return std::ranges::any_of(model_folders,
                             [&](const char* folder) { return has_colmap_model(tree, folder); });
}

FoundCapture read_colmap(const std::shared_ptr<const FileTree>& tree, const CaptureOptions& options) {
  return ColmapReader(tree, options).read();
}

}  // namespace traceflow
