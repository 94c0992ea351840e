#include "compare.h"
#include "alloc.h"
#include <assert.h>
#include <math.h>

#define TAPS  11
#define SIGMA 1.5
// Planes that SSIM filters: a, b, a a, b b, a b.
#define PLANES 5

void hw_luma(const hw_image *image, float *out)
{
    size_t pixels = (size_t)image->width * image->height;
    const uint8_t *p = image->data;
    if (image->channels == 1) {
        for (size_t i = 0; i < pixels; i++)
            out[i] = p[i];
        return;
    }
    for (size_t i = 0; i < pixels; i++, p += image->channels)
        out[i] = (float)(0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2]);
}

double hw_squared_error(const float *a, const float *b, const uint8_t *mask, size_t pixels,
                        size_t *count)
{
    double sum = 0;
    size_t used = 0;
    for (size_t i = 0; i < pixels; i++) {
        if (mask && !mask[i])
            continue;
        double d = (double)a[i] - (double)b[i];
        sum += d * d;
        used++;
    }
    *count = used;
    return sum;
}

double hw_psnr(double mse)
{
    return mse > 0 ? 10 * log10(255.0 * 255.0 / mse) : (double)INFINITY;
}

static void gaussian_window(float taps[TAPS])
{
    double sum = 0, weights[TAPS];
    for (int i = 0; i < TAPS; i++) {
        double x = i - TAPS / 2;
        weights[i] = exp(-x * x / (2 * SIGMA * SIGMA));
        sum += weights[i];
    }
    for (int i = 0; i < TAPS; i++)
        taps[i] = (float)(weights[i] / sum);
}

// Filters TAPS rows of a and b, from row `y` on, down to one row of each plane. Values are centred
// on 128 first: variances do not change, and float keeps the digits that E[x^2] - E[x]^2 cancels.
static void filter_columns(const float *a, const float *b, uint32_t width, size_t y,
                           const float taps[TAPS], float *restrict out)
{
    float *restrict ma = out, *restrict mb = out + width, *restrict aa = out + 2 * (size_t)width;
    float *restrict bb = out + 3 * (size_t)width, *restrict ab = out + 4 * (size_t)width;
    for (size_t i = 0; i < (size_t)width * PLANES; i++)
        out[i] = 0;
    for (int t = 0; t < TAPS; t++) {
        const float *ra = a + (y + (size_t)t) * width, *rb = b + (y + (size_t)t) * width;
        float w = taps[t];
        for (uint32_t x = 0; x < width; x++) {
            float va = ra[x] - 128.0f, vb = rb[x] - 128.0f;
            float wa = w * va, wb = w * vb;
            ma[x] += wa;
            mb[x] += wb;
            aa[x] += wa * va;
            bb[x] += wb * vb;
            ab[x] += wa * vb;
        }
    }
}

// Filters one plane's row; `count` windows.
static void filter_row(const float *restrict in, size_t count, const float taps[TAPS],
                       float *restrict out)
{
    for (size_t x = 0; x < count; x++)
        out[x] = taps[0] * in[x];
    for (int t = 1; t < TAPS; t++) {
        float w = taps[t];
        for (size_t x = 0; x < count; x++)
            out[x] += w * in[x + (size_t)t];
    }
}

// Wang et al. 2004, equation 13, from the filtered planes of one row.
static void similarity_row(const float *planes, size_t stride, size_t count, float *restrict out)
{
    const float c1 = 0.01f * 255 * 0.01f * 255, c2 = 0.03f * 255 * 0.03f * 255;
    const float *ma = planes, *mb = planes + stride, *aa = planes + 2 * stride;
    const float *bb = planes + 3 * stride, *ab = planes + 4 * stride;
    for (size_t x = 0; x < count; x++) {
        float va = aa[x] - ma[x] * ma[x], vb = bb[x] - mb[x] * mb[x], cov = ab[x] - ma[x] * mb[x];
        float mean_a = ma[x] + 128.0f, mean_b = mb[x] + 128.0f;
        float numerator = (2 * (mean_a * mean_b) + c1) * (2 * cov + c2);
        float denominator = (mean_a * mean_a + mean_b * mean_b + c1) * (va + vb + c2);
        out[x] = numerator / denominator;
    }
}

hw_status hw_ssim(const float *a, const float *b, uint32_t width, uint32_t height,
                  const uint8_t *mask, double *out)
{
    *out = 0;
    if (width < TAPS || height < TAPS)
        return hw_fail(HW_USAGE, "SSIM needs images of at least %d x %d pixels, not %u x %u", TAPS,
                       TAPS, width, height);
    float *buffer = NULL, taps[TAPS];
    HW_TRY(HW_NEW(&buffer, (size_t)width * (2 * PLANES + 1)));
    float *columns = buffer, *planes = buffer + (size_t)width * PLANES;
    float *row = planes + (size_t)width * PLANES;
    size_t windows = width - TAPS + 1, used = 0;
    double sum = 0;
    gaussian_window(taps);
    for (size_t y = 0; y + TAPS <= height; y++) {
        filter_columns(a, b, width, y, taps, columns);
        for (size_t p = 0; p < PLANES; p++)
            filter_row(columns + p * width, windows, taps, planes + p * width);
        similarity_row(planes, width, windows, row);
        const uint8_t *m = mask ? mask + (y + TAPS / 2) * width + TAPS / 2 : NULL;
        for (size_t x = 0; x < windows; x++) {
            if (m && !m[x])
                continue;
            sum += (double)row[x];
            used++;
        }
    }
    hw_free(buffer);
    if (used == 0)
        return hw_fail(HW_USAGE, "SSIM of an empty mask");
    *out = sum / (double)used;
    return HW_OK;
}

hw_status hw_difference_image(const hw_image *a, const hw_image *b, float gain, hw_image *out)
{
    assert(a->width == b->width && a->height == b->height);
    assert(a->channels >= 3 && b->channels >= 3);
    HW_TRY(hw_image_make(out, a->width, a->height, 3));
    size_t pixels = (size_t)a->width * a->height;
    for (size_t i = 0; i < pixels; i++) {
        for (size_t k = 0; k < 3; k++) {
            int d = a->data[i * a->channels + k] - b->data[i * b->channels + k];
            float v = gain * (float)(d < 0 ? -d : d) + 0.5f;
            out->data[i * 3 + k] = v >= 255 ? 255 : (uint8_t)v;
        }
    }
    return HW_OK;
}
