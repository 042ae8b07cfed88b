#include "train/options.h"

#include "math/activation.h"

namespace traceflow {

namespace {

// The published values. Hidden layers use bf16 with fp32 sums, at which tensor cores are fast; the layers
// that read encodings keep more digits.
TrainOptions paper_preset() {
  TrainOptions o;
  o.render.precision = field::Precision::bf16;
  return o;
}

// Short runs cannot determine everything from photographs alone, as the paper's 60,000 iterations do. They
// use more of the capture: surfels start opaque at its points, and its masks show what reflects. Reflection
// and normals count from the start, because without them a mirror's surface sinks to the depth of its virtual
// images. Motion is learnt from the first frames on, with bodies if there are masks.
TrainOptions cpu_preset() {
  TrainOptions o;
  o.iterations = 8000;
  o.save_every = 1000;
  o.initial.max_points = 12000;
  o.initial.sh_degree = 2;
  o.initial.opacity = 0.7F;
  o.initial.tint = 0.1F;
  o.initial.tint_in_mask = 0.9F;
  o.initial.environment_sh_degree = 1;
  o.initial.environment_cells = 10;
  o.initial.environment_points = 6000;
  o.initial.map_size = 32;
  o.deform.kind = "nodes";
  o.deform.network.width = 96;
  o.deform.network.depth = 6;
  o.deform.network.skip = 3;
  o.deform.network.position_frequencies = 6;
  o.deform.environment_network = o.deform.network;
  o.deform.environment_network.width = 64;
  o.deform.environment_network.depth = 4;
  o.deform.environment_network.skip = 2;
  o.render.precision = field::Precision::bf16;
  o.render.samples = 2;
  o.render.trace.alpha_min = 0.02F;
  o.render.select.min_tint = 0.05F;
  o.render.select.probe_share = 0.05F;
  o.loss.normal = 0.1F;
  o.loss.normal_prior = 0.3F;
  o.loss.normal_prior_on_mirrors = 7;
  o.loss.rigidity = 0.05F;
  o.rates.position = 1.5e-3F;
  o.rates.position_end = 1.5e-5F;
  o.rates.tint = 0.003F;
  o.rates.field = 1e-3F;
  o.rates.field_end = 3e-4F;
  o.schedule.deform_from = 6000;
  o.schedule.normal_from = 0;
  o.schedule.specular_from = 600;
  o.schedule.joint_from = 1200;
  o.schedule.first_times = 0.05F;
  o.schedule.all_times_from = 36000;
  o.density.every = 600;
  o.density.from = 600;
  o.density.until = 45000;
  o.density.growth = 0.2F;
  o.density.prune_above = 10;
  o.density.prune_above_cloud = 0.5F;
  o.density.longest_needle = 0.1F;
  o.density.prune_above_from = 0;
  o.density.opacity_reset_every = 0;
  o.density.max_surfels = 20000;
  o.environment_density.from = 3000;
  o.environment_density.every = 3000;
  o.environment_density.until = 45000;
  o.environment_density.prune_above_from = 0;
  o.environment_density.prune_opacity = 0.005F;
  o.environment_density.growth = 0.1F;
  o.environment_density.opacity_reset_every = 0;
  o.environment_density.max_surfels = 10000;
  return o;
}

TrainOptions demo_preset() {
  TrainOptions o = cpu_preset();
  o.iterations = 6000;
  o.render.samples = 1;  // 2 would take a fifth longer
  o.density.max_surfels = 16000;
  o.initial.max_points = 8000;
  o.environment_density.max_surfels = 8000;
  return o;
}

}  // namespace

void ScheduleOptions::validate() const {
  check_option(length > 0, "schedule.length", length, "a positive number");
  check_not_negative(deform_from, "schedule.deform_from");
  check_not_negative(normal_from, "schedule.normal_from");
  check_not_negative(specular_from, "schedule.specular_from");
  check_option(joint_from >= specular_from, "schedule.joint_from", joint_from,
               "no less than schedule.specular_from");
  check_option(sh_every > 0, "schedule.sh_every", sh_every, "a positive number");
  check_not_negative(time_jitter, "schedule.time_jitter");
  check_share(first_times, "schedule.first_times");
  check_not_negative(all_times_from, "schedule.all_times_from");
  check_not_negative(samples_from, "schedule.samples_from");
}

void RateOptions::validate() const {
  for (const auto& [value, name] : {std::pair{position, "rates.position"},
                                    {position_end, "rates.position_end"},
                                    {field, "rates.field"},
                                    {field_end, "rates.field_end"},
                                    {motion, "rates.motion"},
                                    {motion_end, "rates.motion_end"},
                                    {map, "rates.map"},
                                    {map_end, "rates.map_end"}}) {
    check_option(value > 0, name, value, "a positive number");
  }
  for (const auto& [value, name] : {std::pair{sh, "rates.sh"},
                                    {opacity, "rates.opacity"},
                                    {log_scale, "rates.log_scale"},
                                    {rotation, "rates.rotation"},
                                    {tint, "rates.tint"},
                                    {roughness, "rates.roughness"},
                                    {camera, "rates.camera"}}) {
    check_not_negative(value, name);
  }
  check_option(sh_rest_divisor > 0, "rates.sh_rest_divisor", sh_rest_divisor, "a positive number");
  check_option(beta1 >= 0 && beta1 < 1, "rates.beta1", beta1, "0 to under 1");
  check_option(beta2 >= 0 && beta2 < 1, "rates.beta2", beta2, "0 to under 1");
  check_option(epsilon > 0, "rates.epsilon", epsilon, "a positive number");
}

void LossOptions::validate() const {
  check_share(ssim, "loss.ssim");
  check_not_negative(normal, "loss.normal");
  check_not_negative(normal_prior, "loss.normal_prior");
  check_not_negative(depth_prior, "loss.depth_prior");
  check_option(depth_prior_until > 0, "loss.depth_prior_until", depth_prior_until, "a positive number");
  check_not_negative(normal_prior_on_mirrors, "loss.normal_prior_on_mirrors");
  check_not_negative(distortion, "loss.distortion");
  check_not_negative(rigidity, "loss.rigidity");
  // The code divides by its square in single precision.
  check_option(rigidity_strain >= 1e-6F, "loss.rigidity_strain", rigidity_strain, "1e-6 or more");
  check_not_negative(silhouette, "loss.silhouette");
  check_not_negative(environment_residual, "loss.environment_residual");
  check_not_negative(lpips, "loss.lpips");
  check_not_negative(lpips_from, "loss.lpips_from");
  if (lpips > 0 && lpips_weights.empty()) {
    throw InputError("option", "loss.lpips_weights", "nothing", "a file of weights, which loss.lpips needs",
                     "write one with scripts/export_lpips.py");
  }
}

void DensityOptions::validate(const std::string& group) const {
  check_option(every > 0, group + ".every", every, "a positive number");
  check_option(opacity_reset_every >= 0, group + ".opacity_reset_every", opacity_reset_every,
               "0 (none) or more");
  check_option(max_surfels > 0, group + ".max_surfels", max_surfels, "a positive number");
  check_option(opacity_reset > 0 && opacity_reset < 1, group + ".opacity_reset", opacity_reset,
               "between 0 and 1");
  check_option(prune_opacity >= 0 && prune_opacity < 1, group + ".prune_opacity", prune_opacity,
               "0 to under 1");
  check_option(prune_above > 0, group + ".prune_above", prune_above, "a positive number");
  check_option(prune_above_cloud > 0, group + ".prune_above_cloud", prune_above_cloud, "a positive number");
  check_not_negative(longest_needle, (group + ".longest_needle").c_str());
  check_not_negative(longest_unseen, (group + ".longest_unseen").c_str());
  check_option(growth > 0 && growth <= 1, group + ".growth", growth, "above 0, up to 1");
  check_option(gradient_threshold > 0, group + ".gradient_threshold", gradient_threshold,
               "a positive number");
}

void LightingOptions::validate() const {
  check_not_negative(cells, "deform.lighting.cells");
  check_option(cells == 0 || (cells >= 2 && cells <= 64), "deform.lighting.cells", cells, "0, or 2 to 64");
  check_option(every > 0, "deform.lighting.every", every, "a positive number");
  check_not_negative(size, "deform.lighting.size");
  check_not_negative(haste, "deform.lighting.haste");
  check_not_negative(roughness, "deform.lighting.roughness");
}
void DeformOptions::validate() const {
  check_not_negative(find, "deform.find");
  check_option(kind == "network" || kind == "nodes", "deform.kind", kind, "network or nodes");
  track.validate();
  bend.validate();
  lighting.validate();
  network.validate();
  environment_network.validate();
}

void InitialOptions::validate() const {
  check_option(max_points > 0, "initial.max_points", max_points, "a positive number");
  check_option(sh_degree >= 0 && sh_degree <= 3, "initial.sh_degree", sh_degree, "0 to 3");
  check_option(environment_sh_degree >= 0 && environment_sh_degree <= 3, "initial.environment_sh_degree",
               environment_sh_degree, "0 to 3");
  for (const auto& [value, name] : {std::pair{opacity, "initial.opacity"},
                                    {tint, "initial.tint"},
                                    {tint_outside_mask, "initial.tint_outside_mask"},
                                    {environment_opacity, "initial.environment_opacity"}}) {
    check_option(value > 0 && value < 1, name, value, "between 0 and 1");
  }
  check_option(tint_in_mask >= 0 && tint_in_mask < 1, "initial.tint_in_mask", tint_in_mask, "0 to under 1");
  check_option(roughness >= 0 && roughness < static_cast<float>(largest_roughness), "initial.roughness",
               roughness, "0 to under 0.25");
  check_option(environment_cells >= 1 && environment_cells <= 128, "initial.environment_cells",
               environment_cells, "1 to 128");
  check_option(environment_per_cell >= 1, "initial.environment_per_cell", environment_per_cell, "1 or more");
  check_option(environment_box > 0, "initial.environment_box", environment_box, "a positive number");
  check_option(environment_points >= 0, "initial.environment_points", environment_points, "0 or more");
  check_option(far_size == 0 || (far_size >= 2 && far_size <= 4096), "initial.far_size", far_size,
               "0, or 2 to 4096");
  check_option(map_size >= 2 && map_size <= 4096, "initial.map_size", map_size, "2 to 4096");
}

void TrainOptions::validate() const {
  check_option(iterations >= 1, "iterations", iterations, "1 or more");
  check_option(save_every >= 1, "save_every", save_every, "1 or more");
  constexpr int64_t pebibyte = int64_t{1} << 30;  // in MiB
  check_option(memory_budget >= 0 && memory_budget <= pebibyte, "memory_budget", memory_budget,
               "0 (automatic) to 2^30 MiB");
  capture.validate();
  initial.validate();
  deform.validate();
  render.validate();
  loss.validate();
  rates.validate();
  schedule.validate();
  density.validate("density");
  environment_density.validate("environment_density");
  check_option(environment_density.longest_unseen == 0, "environment_density.longest_unseen",
               environment_density.longest_unseen, "0: cameras see the environment by reflection");
}

TrainOptions preset(const std::string& name) {
  if (name == "paper") return paper_preset();
  if (name == "cpu") return cpu_preset();
  if (name == "demo") return demo_preset();
  throw InputError("option", "preset", name, "paper, cpu or demo");
}

}  // namespace traceflow
