// The only file that knows OpenImageIO. Nothing thrown in here may leave it: every entry point runs
// inside guarded().
#include <stddef.h>
#include <stdint.h>
extern "C" {
#include "alloc.h"
#include "file.h"
#include "image_io.h"
}
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <OpenImageIO/imagecache.h>
#include <OpenImageIO/imageio.h>
#include <OpenImageIO/strutil.h>
#include <OpenImageIO/texture.h>
#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <memory>
#include <mutex>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

namespace
{

constexpr uint64_t file_limit_bytes = uint64_t(1) << 30;
constexpr int tile_side = 64;
constexpr int jpeg_quality = 92; // where the caller has no wish
constexpr const char *png_signature = "\x89PNG\r\n\x1a\n";

// OpenImageIO's own threads would only compete with ours.
void set_up_once()
{
    static std::once_flag once;
    std::call_once(once, [] { OIIO::attribute("threads", 1); });
}

template <class Body> hw_status guarded(const char *name, Body body) noexcept
{
    try {
        set_up_once();
        return body();
    } catch (const std::bad_alloc &) {
        return hw_fail(HW_MEMORY, "%s: out of memory", name);
    } catch (const std::exception &e) {
        return hw_fail(HW_FORMAT, "%s: %s", name, e.what());
    } catch (...) {
        return hw_fail(HW_INTERNAL, "%s: unknown exception", name);
    }
}

// `text` comes from a geterror(): that also clears the message, which would else be printed at
// exit.
hw_status fail_with(hw_status status, const char *name, std::string text)
{
    while (!text.empty() && (text.back() == '\n' || text.back() == '.'))
        text.pop_back();
    std::replace(text.begin(), text.end(), '\n', ' ');
    return hw_fail(status, "%s: %s", name, text.empty() ? "unreadable image" : text.c_str());
}

struct signature {
    const char *bytes;
    size_t size;
    size_t offset;
    const char *extension;
};

// Content tells the format better than a name does: textures inside GLB files have none.
const char *format_of(const uint8_t *data, size_t size)
{
    static const signature known[] = {
        {png_signature, 8, 0, "png"},
        {"\xff\xd8\xff", 3, 0, "jpg"},
        {"GIF8", 4, 0, "gif"},
        {"BM", 2, 0, "bmp"},
        {"II*\0", 4, 0, "tif"},
        {"MM\0*", 4, 0, "tif"},
        {"WEBP", 4, 8, "webp"},
        {"DDS ", 4, 0, "dds"},
        {"\x76\x2f\x31\x01", 4, 0, "exr"},
        {"8BPS", 4, 0, "psd"},
        {"#?RADIANCE", 10, 0, "hdr"},
    };
    for (const signature &s : known)
        if (size >= s.offset + s.size && memcmp(data + s.offset, s.bytes, s.size) == 0)
            return s.extension;
    return nullptr;
}

// CRC-32 of PNG chunks (ISO 3309, PNG specification annex D).
uint32_t png_crc(const uint8_t *data, size_t size)
{
    static const std::array<uint32_t, 256> table = [] {
        std::array<uint32_t, 256> t{};
        for (uint32_t i = 0; i < 256; i++) {
            uint32_t c = i;
            for (int k = 0; k < 8; k++)
                c = c & 1 ? 0xedb88320u ^ c >> 1 : c >> 1;
            t[i] = c;
        }
        return t;
    }();
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < size; i++)
        crc = table[(crc ^ data[i]) & 255] ^ crc >> 8;
    return ~crc;
}

uint32_t big_endian(const uint8_t *p)
{
    return uint32_t(p[0]) << 24 | uint32_t(p[1]) << 16 | uint32_t(p[2]) << 8 | p[3];
}

// Whether the signature and all chunks of a PNG are whole, from IHDR to IEND. libpng would print
// its complaints on stderr, and accept a file that ends before its last chunk.
bool png_is_whole(const uint8_t *data, size_t size)
{
    size_t at = 8;
    if (size < at || memcmp(data, png_signature, at) != 0)
        return false;
    for (bool first = true;; first = false) {
        if (size - at < 12)
            return false;
        const uint64_t length = big_endian(data + at);
        const uint8_t *type = data + at + 4;
        if (length > size - at - 12 || (first && memcmp(type, "IHDR", 4) != 0) ||
            png_crc(type, size_t(length) + 4) != big_endian(type + 4 + length))
            return false;
        if (memcmp(type, "IEND", 4) == 0)
            return true;
        at += size_t(length) + 12;
    }
}

// Copies what was read into the channel counts of hw_image: 1 stays, 2 (gray and alpha) becomes 4,
// more than 4 are cut.
hw_status read_pixels(OIIO::ImageInput &in, const char *name, hw_image *out)
{
    const OIIO::ImageSpec spec = in.spec();
    if (spec.width < 1 || spec.height < 1 || spec.nchannels < 1 || spec.depth > 1)
        return hw_fail(HW_FORMAT, "%s: not a two-dimensional image", name);
    const int stored = std::min(spec.nchannels, 4);
    const uint32_t wanted = stored == 2 ? 4 : uint32_t(stored);
    hw_status status = hw_image_make(out, uint32_t(spec.width), uint32_t(spec.height), wanted);
    if (status != HW_OK)
        return hw_fail_prefix(status, name);
    if (!in.read_image(0, 0, 0, stored, OIIO::TypeDesc::UINT8, out->data, OIIO::stride_t(wanted))) {
        hw_image_free(out);
        return fail_with(HW_FORMAT, name, in.geterror());
    }
    const size_t pixels = size_t(spec.width) * size_t(spec.height);
    if (stored == 2)
        for (size_t i = 0; i < pixels; i++) {
            uint8_t *p = out->data + i * 4;
            p[3] = p[1];
            p[1] = p[2] = p[0];
        }
    return HW_OK;
}

// Alpha is a channel like the others here: never multiplied in.
OIIO::ImageSpec plain_alpha()
{
    OIIO::ImageSpec config;
    config["oiio:UnassociatedAlpha"] = 1;
    return config;
}

hw_status decode(const char *name, const void *bytes, size_t size, const char *path, hw_image *out)
{
    const uint8_t *data = static_cast<const uint8_t *>(bytes);
    const char *extension = format_of(data, size);
    const bool png =
        extension ? strcmp(extension, "png") == 0 : OIIO::Strutil::iends_with(name, ".png");
    if (png && !png_is_whole(data, size))
        return hw_fail(HW_FORMAT, "%s: truncated or damaged PNG", name);
    const std::string alias = extension ? std::string("image.") + extension : std::string(name);
    const OIIO::ImageSpec config = plain_alpha();
    OIIO::Filesystem::IOMemReader memory(bytes, size);
    OIIO::ImageSpec spec;
    // Given the proxy, create() probes the bytes instead of a file of that name. A reader that
    // cannot read from memory refuses the proxy; a file can then be opened by name.
    auto in = OIIO::ImageInput::create(alias, false, nullptr, &memory);
    if (in && in->set_ioproxy(&memory)) {
        if (!in->open(alias, spec, config))
            return fail_with(HW_FORMAT, name, in->geterror());
    } else if (path) {
        (void)OIIO::geterror();
        in = OIIO::ImageInput::open(path, &config);
    } else {
        in.reset();
    }
    if (!in)
        return fail_with(HW_FORMAT, name, OIIO::geterror());
    hw_status status = read_pixels(*in, name, out);
    in->close();
    return status;
}

hw_status encode(const char *name, const hw_image *image, int quality,
                 std::vector<unsigned char> &buffer)
{
    auto output = OIIO::ImageOutput::create(name);
    if (!output)
        return fail_with(HW_USAGE, name, OIIO::geterror());
    if (!output->supports("ioproxy"))
        return hw_fail(HW_USAGE, "%s: images are not written as %s", name, output->format_name());
    const int channels =
        image->channels == 4 && !output->supports("alpha") ? 3 : int(image->channels);
    OIIO::ImageSpec spec(int(image->width), int(image->height), channels, OIIO::TypeDesc::UINT8);
    spec["oiio:UnassociatedAlpha"] = 1;
    spec["jpeg:subsampling"] = "4:4:4";
    if (strcmp(output->format_name(), "jpeg") == 0)
        spec["Compression"] = "jpeg:" + std::to_string(quality);
    OIIO::Filesystem::IOVecOutput memory(buffer);
    if (!output->set_ioproxy(&memory) || !output->open(name, spec) ||
        !output->write_image(OIIO::TypeDesc::UINT8, image->data, OIIO::stride_t(image->channels)) ||
        !output->close())
        return fail_with(HW_IO, name, output->geterror());
    return HW_OK;
}

// One level of a mip pyramid, RGB.
struct level {
    int width, height;
    std::vector<uint8_t> pixels;
};
using pyramid = std::vector<level>;

// Each level is the exact box filter of the one before, also for odd sides.
level halve(const level &from)
{
    level to{std::max(1, from.width / 2), std::max(1, from.height / 2), {}};
    to.pixels.resize(size_t(to.width) * size_t(to.height) * 3);
    OIIO::ImageSpec from_spec(from.width, from.height, 3, OIIO::TypeDesc::UINT8);
    OIIO::ImageSpec to_spec(to.width, to.height, 3, OIIO::TypeDesc::UINT8);
    // ImageBuf wraps the pixels without copying; the source is not written to.
    OIIO::ImageBuf source(from_spec, const_cast<uint8_t *>(from.pixels.data()));
    OIIO::ImageBuf target(to_spec, to.pixels.data());
    if (!OIIO::ImageBufAlgo::resize(target, source, "box", 0.0f, OIIO::ROI::All(), 1))
        throw std::runtime_error("mip level: " + target.geterror());
    return to;
}

// How often to repeat the image across and down so that its texels become about square in texture
// space. The texture system picks the mip level by the shorter side alone and would hardly filter a
// long image along its length; as look-ups wrap, repeating changes nothing else.
void choose_repeats(const hw_image *image, uint32_t repeats[2])
{
    const uint32_t sides[2] = {image->width, image->height};
    const int shorter = sides[0] < sides[1] ? 0 : 1;
    const uint32_t wanted = (sides[1 - shorter] + sides[shorter] / 2) / sides[shorter];
    repeats[shorter] = std::min(wanted, 16u);
    repeats[1 - shorter] = 1;
}

pyramid make_pyramid(const hw_image *image, const uint32_t repeats[2])
{
    level base{int(image->width * repeats[0]), int(image->height * repeats[1]), {}};
    const size_t width = size_t(base.width), height = size_t(base.height);
    base.pixels.resize(width * height * 3);
    uint8_t *out = base.pixels.data();
    for (size_t y = 0; y < height; y++)
        for (size_t x = 0; x < width; x++, out += 3) {
            const size_t pixel = y % image->height * image->width + x % image->width;
            const uint8_t *p = image->data + pixel * image->channels;
            out[0] = p[0];
            out[1] = p[image->channels < 3 ? 0 : 1];
            out[2] = p[image->channels < 3 ? 0 : 2];
        }
    pyramid levels;
    levels.push_back(std::move(base));
    while (levels.back().width > 1 || levels.back().height > 1)
        levels.push_back(halve(levels.back()));
    return levels;
}

// Feeds a pyramid in memory to the texture system, which only knows how to read files. The pyramid
// comes through the open call's configuration.
class memory_input final : public OIIO::ImageInput
{
  public:
    const char *format_name() const override { return "hexwalk-memory"; }
    bool valid_file(const std::string &) const override { return true; }
    bool open(const std::string &, OIIO::ImageSpec &) override { return false; }
    bool open(const std::string &, OIIO::ImageSpec &spec, const OIIO::ImageSpec &config) override
    {
        const OIIO::ParamValue *value = config.find_attribute(attribute_name, OIIO::TypeDesc::PTR);
        if (!value)
            return false;
        levels_ = static_cast<const pyramid *>(*static_cast<void *const *>(value->data()));
        if (!seek_subimage(0, 0))
            return false;
        spec = m_spec;
        return true;
    }
    bool close() override { return true; }
    int current_subimage() const override { return 0; }
    int current_miplevel() const override { return miplevel_; }
    bool seek_subimage(int subimage, int miplevel) override
    {
        if (!levels_ || subimage != 0 || miplevel < 0 || size_t(miplevel) >= levels_->size())
            return false;
        const level &l = (*levels_)[size_t(miplevel)];
        miplevel_ = miplevel;
        m_spec = OIIO::ImageSpec(l.width, l.height, 3, OIIO::TypeDesc::UINT8);
        m_spec.tile_width = m_spec.tile_height = tile_side;
        m_spec.tile_depth = 1;
        m_spec["textureformat"] = "Plain Texture";
        return true;
    }
    bool read_native_scanline(int, int, int, int, void *) override { return false; }
    bool read_native_tile(int subimage, int miplevel, int x, int y, int, void *data) override
    {
        if (!levels_ || subimage != 0 || miplevel < 0 || size_t(miplevel) >= levels_->size())
            return false;
        const level &l = (*levels_)[size_t(miplevel)];
        auto *out = static_cast<uint8_t *>(data);
        for (int row = 0; row < tile_side; row++) {
            const int from_y = std::min(y + row, l.height - 1);
            const int count = std::max(0, std::min(tile_side, l.width - x));
            uint8_t *target = out + size_t(row) * tile_side * 3;
            memset(target, 0, size_t(tile_side) * 3);
            memcpy(target, &l.pixels[(size_t(from_y) * size_t(l.width) + size_t(x)) * 3],
                   size_t(count) * 3);
        }
        return true;
    }
    static constexpr const char *attribute_name = "hexwalk:pyramid";

  private:
    const pyramid *levels_ = nullptr;
    int miplevel_ = 0;
};

OIIO::ImageInput *make_memory_input()
{
    return new memory_input;
}

} // namespace

// The pyramid must outlive its entry in the texture system.
struct hw_sampler {
    pyramid levels;
    uint32_t repeats[2] = {1, 1};
    OIIO::TextureSystem *system = nullptr; // the process's shared one, never destroyed
    OIIO::ustring name;
    OIIO::TextureSystem::TextureHandle *texture = nullptr;
    float mean[3] = {0, 0, 0};

    ~hw_sampler()
    {
        // Drops the tiles and the reader; names are never used twice.
        if (system && !name.empty())
            system->invalidate(name, true);
    }
};

namespace
{

hw_status set_up_sampler(hw_sampler &sampler, const hw_image *image)
{
    static std::atomic<unsigned> serial{0};
    choose_repeats(image, sampler.repeats);
    sampler.levels = make_pyramid(image, sampler.repeats);
    for (int k = 0; k < 3; k++)
        sampler.mean[k] = float(sampler.levels.back().pixels[size_t(k)]) / 255.0f;
    sampler.system = OIIO::TextureSystem::create(true);
    if (!sampler.system)
        return fail_with(HW_INTERNAL, "texture", OIIO::geterror());
    sampler.name = OIIO::ustring("hexwalk-memory-" + std::to_string(serial++));
    OIIO::ImageSpec config;
    void *pointer = &sampler.levels;
    config.attribute(memory_input::attribute_name, OIIO::TypeDesc::PTR, &pointer);
    // The cache keeps the configuration, and opens the input when the handle is asked for.
    OIIO::ImageCache *cache = sampler.system->imagecache();
    if (!cache->add_file(sampler.name, make_memory_input, &config))
        return fail_with(HW_INTERNAL, "texture", cache->geterror());
    sampler.texture = sampler.system->get_texture_handle(sampler.name);
    if (!sampler.texture || !sampler.system->good(sampler.texture))
        return fail_with(HW_INTERNAL, "texture", sampler.system->geterror());
    return HW_OK;
}

} // namespace

extern "C" hw_status hw_image_read(const char *path, hw_image *out)
{
    *out = hw_image();
    uint8_t *data = nullptr;
    size_t size = 0;
    HW_TRY(hw_file_read(path, file_limit_bytes, &data, &size));
    hw_status status = size == 0
                           ? hw_fail(HW_FORMAT, "%s: empty file", path)
                           : guarded(path, [&] { return decode(path, data, size, path, out); });
    hw_free(data);
    if (status != HW_OK)
        hw_image_free(out);
    return status;
}

extern "C" hw_status hw_image_decode(const char *name, const void *bytes, size_t size,
                                     hw_image *out)
{
    *out = hw_image();
    if (size == 0)
        return hw_fail(HW_FORMAT, "%s: empty image", name);
    hw_status status = guarded(name, [&] { return decode(name, bytes, size, nullptr, out); });
    if (status != HW_OK)
        hw_image_free(out);
    return status;
}

extern "C" hw_status hw_image_write(const char *path, const hw_image *image)
{
    return guarded(path, [&] {
        std::vector<unsigned char> buffer;
        HW_TRY(encode(path, image, jpeg_quality, buffer));
        return hw_file_write(path, buffer.data(), buffer.size());
    });
}

static hw_status encode_to_block(const char *name, const hw_image *image, int quality,
                                 uint8_t **bytes, size_t *size)
{
    *bytes = nullptr;
    *size = 0;
    return guarded(name, [&] {
        std::vector<unsigned char> buffer;
        HW_TRY(encode(name, image, quality, buffer));
        void *block = nullptr;
        HW_TRY(hw_alloc(&block, buffer.size(), 1));
        memcpy(block, buffer.data(), buffer.size());
        *bytes = static_cast<uint8_t *>(block);
        *size = buffer.size();
        return HW_OK;
    });
}

extern "C" hw_status hw_image_encode_png(const hw_image *image, uint8_t **bytes, size_t *size)
{
    return encode_to_block("image.png", image, jpeg_quality, bytes, size);
}

extern "C" hw_status hw_image_encode_jpeg(const hw_image *image, int quality, uint8_t **bytes,
                                          size_t *size)
{
    return encode_to_block("image.jpg", image, std::clamp(quality, 1, 100), bytes, size);
}

extern "C" hw_status hw_sampler_create(hw_sampler **out, const hw_image *image)
{
    *out = nullptr;
    return guarded("texture", [&] {
        auto sampler = std::make_unique<hw_sampler>();
        HW_TRY(set_up_sampler(*sampler, image));
        *out = sampler.release();
        return HW_OK;
    });
}

extern "C" void hw_sampler_destroy(hw_sampler *sampler)
{
    (void)guarded("texture", [&] {
        delete sampler;
        return HW_OK;
    });
}

extern "C" void hw_sampler_lookup(const hw_sampler *sampler, float u, float v, const float dx[2],
                                  const float dy[2], float rgb[3])
{
    // Should a look-up fail (memory), the mean colour stands in: a look-up has no way to report.
    memcpy(rgb, sampler->mean, sizeof sampler->mean);
    (void)guarded("texture", [&] {
        OIIO::TextureOpt options;
        options.swrap = options.twrap = OIIO::TextureOpt::WrapPeriodic;
        options.interpmode = OIIO::TextureOpt::InterpBilinear;
        const float s = 1 / float(sampler->repeats[0]), t = 1 / float(sampler->repeats[1]);
        float result[3];
        if (sampler->system->texture(sampler->texture, sampler->system->get_perthread_info(),
                                     options, u * s, v * t, dx[0] * s, dx[1] * t, dy[0] * s,
                                     dy[1] * t, 3, result))
            memcpy(rgb, result, sizeof result);
        else
            (void)sampler->system->geterror();
        return HW_OK;
    });
}
