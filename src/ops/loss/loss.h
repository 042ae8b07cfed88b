#pragma once

#include "ops/loss/mean.h"

// The terms of the training loss (method §7.4), each a mean, each with its gradient. Every function leaves
// the term's value in a slot and ADDS weight · dterm/dinput to the gradient tensors, so that terms can share
// them. They run where the pictures are. The mean of nothing is 0. Sums in a fixed order. A non-finite input
// shows in the value, so that training notices, and gets no gradient; it never makes another pixel's gradient
// non-finite. The references return the value.
namespace traceflow::loss {

// mean |image − target| over pixels and channels. image, target, grad_image: H×W×3.
void l1(const Tensor<float>& image, const Tensor<float>& target, double weight, Tensor<float>& grad_image,
        const MeanSlot& value);
double l1_reference(const Tensor<double>& image, const Tensor<double>& target, double weight,
                    Tensor<double>& grad_image);

// mean (1 − SSIM): 11×11 Gaussian window, σ 1.5, zero padding, C1 0.01², C2 0.03², over the whole map (method
// §7.5).
void ssim_loss(const Tensor<float>& image, const Tensor<float>& target, double weight,
               Tensor<float>& grad_image, const MeanSlot& value);
double ssim_loss_reference(const Tensor<double>& image, const Tensor<double>& target, double weight,
                           Tensor<double>& grad_image);
// Mean SSIM alone, for metrics; mask (H×W, may be empty) restricts the mean to pixels where it is non-zero.
// NaN where there are none. The host waits for it.
double ssim(const Tensor<float>& image, const Tensor<float>& target, const Tensor<uint8_t>& mask);

// L_norm = mean (1 − n·N_d) over pixels where N_d is not zero (method §7.4). normal: the blended normal,
// H×W×3, as is (its length is alpha-weighted); pseudo: H×W×3 unit or zero. Differentiable in both. The mean
// divides by H·W, so that a frame that is half empty weighs half.
void normal_consistency(const Tensor<float>& normal, const Tensor<float>& pseudo, double weight,
                        Tensor<float>& grad_normal, Tensor<float>& grad_pseudo, const MeanSlot& value);
double normal_consistency_reference(const Tensor<double>& normal, const Tensor<double>& pseudo, double weight,
                                    Tensor<double>& grad_normal, Tensor<double>& grad_pseudo);

// L_tc-norm = mean w (1 − n̂·N_e) over pixels that have a prior (N_e not zero) and a blended normal (method
// §7.4); n̂ the blended normal normalised; divides by the number of such pixels. prior: H×W×3, world axes,
// unit or zero. w = 1 + (on_mirrors − 1) tint, a constant to the gradient; tint: H×W in [0, 1], empty: 0.
void normal_prior(const Tensor<float>& normal, const Tensor<float>& prior, const Tensor<float>& tint,
                  double on_mirrors, double weight, Tensor<float>& grad_normal, const MeanSlot& value);
double normal_prior_reference(const Tensor<double>& normal, const Tensor<double>& prior,
                              const Tensor<double>& tint, double on_mirrors, double weight,
                              Tensor<double>& grad_normal);

// mean of the distortion map (method §3.5).
void distortion(const Tensor<float>& distortion_map, double weight, Tensor<float>& grad_distortion,
                const MeanSlot& value);

// mean H(silhouette − mask) over pixels, H(x) = x²/0.2 up to |x| = 0.1 and |x| − 0.05 beyond: what lies in
// the mask's border pixels, of which a mask knows the least, pulls less. silhouette, mask: H×W in [0, 1].
void silhouette(const Tensor<float>& silhouette, const Tensor<float>& mask, double weight,
                Tensor<float>& grad_silhouette, const MeanSlot& value);
double silhouette_reference(const Tensor<double>& silhouette, const Tensor<double>& mask, double weight,
                            Tensor<double>& grad_silhouette);

// mean (√(|r|² + ε²) − ε) over rows r, ε = 0.001: how far residuals are from zero. Rows that are zero stay so
// unless the pictures gain more than the weight, so that few rows differ from zero. A row that is not finite
// counts as zero. rows: N×K.
void row_norm(const Tensor<float>& rows, double weight, Tensor<float>& grad_rows, const MeanSlot& value);
double row_norm_reference(const Tensor<double>& rows, double weight, Tensor<double>& grad_rows);

// mean (image − target)² over channels and pixels, which PSNR is made of; no term of the loss. known (H×W,
// may be empty) restricts the mean to pixels where it is non-zero.
void squared_error(const Tensor<float>& image, const Tensor<float>& target, const Tensor<uint8_t>& known,
                   const MeanSlot& value);

}  // namespace traceflow::loss
