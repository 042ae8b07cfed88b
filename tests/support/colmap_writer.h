#pragma once

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace traceflow {

// A COLMAP model's files, written as its documentation says, with anything in them.
struct ColmapFiles {
  struct Camera {
    uint32_t id;
    int model;
    std::string name;
    uint64_t width, height;
    std::vector<double> parameters;
  };
  struct Image {
    uint32_t id;
    std::array<double, 4> quaternion;
    std::array<double, 3> translation;
    uint32_t camera;
    std::string name;
    std::vector<int64_t> points;  // ids, -1: none
  };
  struct Point {
    uint64_t id;
    std::array<double, 3> position;
    std::array<uint8_t, 3> colour;
    double error;
    uint64_t track;
  };
  std::vector<Camera> cameras;
  std::vector<Image> images;
  std::vector<Point> points;

  std::string cameras_binary() const {
    std::string bytes = of<uint64_t>(cameras.size());
    for (const Camera& c : cameras) {
      bytes += of(c.id) + of<int32_t>(c.model) + of(c.width) + of(c.height);
      for (const double p : c.parameters) bytes += of(p);
    }
    return bytes;
  }
  std::string images_binary() const {
    std::string bytes = of<uint64_t>(images.size());
    for (const Image& image : images) {
      bytes += of(image.id);
      for (const double q : image.quaternion) bytes += of(q);
      for (const double t : image.translation) bytes += of(t);
      bytes += of(image.camera) + image.name + '\0' + of<uint64_t>(image.points.size());
      for (const int64_t point : image.points) bytes += of(1.5) + of(2.5) + of(point);
    }
    return bytes;
  }
  std::string points_binary() const {
    std::string bytes = of<uint64_t>(points.size());
    for (const Point& point : points) {
      bytes += of(point.id);
      for (const double x : point.position) bytes += of(x);
      for (const uint8_t c : point.colour) bytes += static_cast<char>(c);
      bytes += of(point.error) + of(point.track) + std::string(8 * point.track, '\1');
    }
    return bytes;
  }
  std::string cameras_text() const {
    std::string text = "# Camera list with one line of data per camera:\n";
    for (const Camera& c : cameras) {
      text += std::to_string(c.id) + " " + c.name + " " + std::to_string(c.width) + " " +
              std::to_string(c.height);
      for (const double p : c.parameters) text += " " + digits(p);
      text += "\n";
    }
    return text;
  }
  std::string images_text() const {
    std::string text = "# Image list with two lines of data per image:\n";
    for (const Image& image : images) {
      text += std::to_string(image.id);
      for (const double q : image.quaternion) text += " " + digits(q);
      for (const double t : image.translation) text += " " + digits(t);
      text += " " + std::to_string(image.camera) + " " + image.name + "\n";
      for (const int64_t point : image.points) text += "1.5 2.5 " + std::to_string(point) + " ";
      text += "\n";
    }
    return text;
  }
  std::string points_text() const {
    std::string text = "# 3D point list with one line of data per point:\n";
    for (const Point& point : points) {
      text += std::to_string(point.id);
      for (const double x : point.position) text += " " + digits(x);
      for (const uint8_t c : point.colour) text += " " + std::to_string(c);
      text += " " + digits(point.error);
      for (uint64_t i = 0; i < point.track; ++i) text += " 1 2";
      text += "\n";
    }
    return text;
  }

  void save_binary(const std::filesystem::path& folder) const {
    write(folder / "cameras.bin", cameras_binary());
    write(folder / "images.bin", images_binary());
    write(folder / "points3D.bin", points_binary());
  }
  void save_text(const std::filesystem::path& folder) const {
    write(folder / "cameras.txt", cameras_text());
    write(folder / "images.txt", images_text());
    write(folder / "points3D.txt", points_text());
  }
  static void write(const std::filesystem::path& path, const std::string& bytes) {
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << bytes;
  }

 private:
  template <class T>
  static std::string of(T value) {
    std::string bytes(sizeof(T), '\0');
    std::memcpy(bytes.data(), &value, sizeof(T));
    return bytes;
  }
  static std::string digits(double value) {
    std::array<char, 40> text{};
    std::snprintf(text.data(), text.size(), "%.17g", value);
    return text.data();
  }
};

}  // namespace traceflow
