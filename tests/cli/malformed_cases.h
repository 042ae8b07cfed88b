#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

// Kinds of malformed input with the expected messages: the cases of docs/malformed.md.
namespace traceflow::cli {

// Bytes by path, below the folder that the program is run in.
using Files = std::map<std::string, std::string>;

struct MalformedCase {
  std::string what;                   // is wrong, in words
  std::vector<std::string> command;   // without the program's name
  std::function<void(Files&)> spoil;  // of good_files()
  std::string line;                   // that is printed, after "traceflow: "
  std::function<void(const std::filesystem::path& folder)> arrange = nullptr;  // what are no files
};

struct MalformedKind {
  std::string title;
  std::vector<MalformedCase> cases;
};

// Whole captures in capture/ (NeRF-DS), colmap/ and transforms/, a scene.ply, a scene.spz, rays.npy,
// cameras.json and a run in run/, all of which can be used.
const Files& good_files();

MalformedKind malformed_json();
MalformedKind malformed_colmap();
MalformedKind malformed_transforms();
MalformedKind malformed_camera_lists();
MalformedKind malformed_arrays();
MalformedKind malformed_plys();
MalformedKind malformed_spzs();
MalformedKind malformed_checkpoints();
MalformedKind malformed_images();
MalformedKind malformed_archives();
MalformedKind malformed_options();
MalformedKind malformed_folders();

// A command that most of the captures' cases are of.
inline const std::vector<std::string> inspect_capture = {"inspect", "-d", "capture"};

// Edits of good files.
std::function<void(Files&)> put(const std::string& file, const std::string& bytes);
std::function<void(Files&)> cut(const std::string& file, size_t bytes);
std::function<void(Files&)> replace(const std::string& file, const std::string& from, const std::string& to);
std::function<void(Files&)> remove(const std::string& file);
// pointer: as in "/train_ids/0"; a value that is discarded takes the field away.
std::function<void(Files&)> set(const std::string& file, const std::string& pointer,
                                const nlohmann::json& value);
std::function<void(Files&)> unset(const std::string& file, const std::string& pointer);

}  // namespace traceflow::cli
