// Image comparison: PSNR on luma and SSIM, whole images or masked.
#pragma once
#include "image.h"
#include <stdbool.h>

// Luma Y = 0.299 R + 0.587 G + 0.114 B of every pixel as float, width * height values
// (thesis 5.3.2).
void hw_luma(const hw_image *image, float *out);
// Sum of squared luma differences over pixels with mask[i] != 0 (mask NULL: all); *count gets the
// number of pixels.
double hw_squared_error(const float *a, const float *b, const uint8_t *mask, size_t pixels,
                        size_t *count);
// 10 log10(255^2 / mse); +inf for mse 0.
double hw_psnr(double mse);
// Mean SSIM of two luma planes (Wang et al. 2004: Gaussian window 11 x 11, sigma 1.5, K1 .01, K2
// .03, L 255), over windows whose centre has mask != 0 (NULL: all). 1 for equal images. HW_USAGE if
// an image is smaller than the window or the mask is empty.
HW_MUST_USE hw_status hw_ssim(const float *a, const float *b, uint32_t width, uint32_t height,
                              const uint8_t *mask, double *out);
// |a - b| times gain, clamped, as a 3-channel image of the size of a and b (same size and channels
// >= 3).
HW_MUST_USE hw_status hw_difference_image(const hw_image *a, const hw_image *b, float gain,
                                          hw_image *out);
