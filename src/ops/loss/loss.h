#pragma once

#include "ops/loss/mean.h"

// The terms of the training loss (method §7.4). Each is a mean and has a gradient. Every function writes the
// term's value to a slot and ADDS weight · dterm/dinput to the gradient tensors, so that terms can share
// them. They run on the device of the images. The mean of nothing is 0. Sums in a fixed order. An input that
// is not finite shows in the value, so that training notices it, and gets no gradient; it never spoils
// another pixel's gradient. The references return the value.
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
// Mean SSIM without a gradient, for metrics. mask (H×W, may be empty) restricts the mean to pixels where it
// is non-zero. NaN if there are none. The host waits for it.
double ssim(const Tensor<float>& image, const Tensor<float>& target, const Tensor<uint8_t>& mask);

// L_norm = mean (min(1, 2α) − n·N_d) over pixels where N_d is not zero (method §7.4). normal: the blended
// normal, H×W×3, not normalised (its length contains alpha); alpha: H×W; pseudo: H×W×3 unit or zero.
// Differentiable in all three. A pixel whose hits agree with N_d gains by becoming opaque above α = 0.5, and
// by becoming empty below it. The mean divides by H·W, so that a half-empty frame weighs half.
void normal_consistency(const Tensor<float>& normal, const Tensor<float>& alpha, const Tensor<float>& pseudo,
                        double weight, Tensor<float>& grad_normal, Tensor<float>& grad_alpha,
                        Tensor<float>& grad_pseudo, const MeanSlot& value);
double normal_consistency_reference(const Tensor<double>& normal, const Tensor<double>& alpha,
                                    const Tensor<double>& pseudo, double weight, Tensor<double>& grad_normal,
                                    Tensor<double>& grad_alpha, Tensor<double>& grad_pseudo);

// L_tc-norm = mean w (1 − n̂·N_e) over pixels that have a prior (N_e not zero) and a blended normal (method
// §7.4). n̂ is the normalised blended normal; the mean divides by the number of such pixels. prior: H×W×3,
// world axes, unit or zero. w = 1 + (on_mirrors − 1) tint is a constant to the gradient; tint: H×W in [0, 1],
// empty: 0.
void normal_prior(const Tensor<float>& normal, const Tensor<float>& prior, const Tensor<float>& tint,
                  double on_mirrors, double weight, Tensor<float>& grad_normal, const MeanSlot& value);
double normal_prior_reference(const Tensor<double>& normal, const Tensor<double>& prior,
                              const Tensor<double>& tint, double on_mirrors, double weight,
                              Tensor<double>& grad_normal);

// mean of the distortion map (method §3.5).
void distortion(const Tensor<float>& distortion_map, double weight, Tensor<float>& grad_distortion,
                const MeanSlot& value);

// mean H(silhouette − mask) over pixels, with H(x) = x²/0.2 up to |x| = 0.1 and |x| − 0.05 beyond: a mask is
// least certain in its border pixels, so they have a smaller gradient. silhouette, mask: H×W in [0, 1].
void silhouette(const Tensor<float>& silhouette, const Tensor<float>& mask, double weight,
                Tensor<float>& grad_silhouette, const MeanSlot& value);
double silhouette_reference(const Tensor<double>& silhouette, const Tensor<double>& mask, double weight,
                            Tensor<double>& grad_silhouette);

// mean H(D/D* − 1) over pixels that have a prior D* and a depth D, with H(x) = x²/0.1 up to |x| = 0.05 and
// |x| − 0.025 beyond: a prior's edges lie beside the image's, and are wrong by more than its surfaces. The
// mean divides by H·W, so that priors on half of the pixels weigh half. depth, prior: H×W, camera z, 0: none.
void depth_prior(const Tensor<float>& depth, const Tensor<float>& prior, double weight,
                 Tensor<float>& grad_depth, const MeanSlot& value);
double depth_prior_reference(const Tensor<double>& depth, const Tensor<double>& prior, double weight,
                             Tensor<double>& grad_depth);

// mean (√(|r|² + ε²) − ε) over rows r, ε = 0.001: how far residuals are from zero. Zero rows remain zero
// unless the other terms gain more than the weight, so that few rows differ from zero. A row that is not
// finite counts as zero. rows: N×K.
void row_norm(const Tensor<float>& rows, double weight, Tensor<float>& grad_rows, const MeanSlot& value);
double row_norm_reference(const Tensor<double>& rows, double weight, Tensor<double>& grad_rows);

// mean (image − target)² over channels and pixels, for PSNR; not a term of the loss. known (H×W, may be
// empty) restricts the mean to pixels where it is non-zero.
void squared_error(const Tensor<float>& image, const Tensor<float>& target, const Tensor<uint8_t>& known,
                   const MeanSlot& value);

}  // namespace traceflow::loss
