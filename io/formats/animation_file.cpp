// SPDX-License-Identifier: GPL-3.0-or-later
// PC2: "POINTCACHE2\0", then little-endian: int version 1, int points, float first frame,
// float frames a sample, int samples, then x y z as floats, sample by sample.
// MDD (big-endian): int frames, int points, a float time for each frame [s], then x y z.
//
// GLB: the mesh at rest, about the middle of its box (floats keep their digits there; the
// node stands where that is), and for each frame a morph target, the ways from rest. Keys
// of their weights show one target at each frame's time; between two frames the weights,
// and so the places, go straight from one to the next. A single frame does not move: the
// mesh is as it has it, for viewers that show a file at its first time or know no
// targets. A sample that corners show with several texture coordinates is several
// vertices. Groups of faces are primitives, whose materials have their names. [glTF2]
#include "io/formats/animation_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <numeric>
#include <optional>

#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/spill.h"
#include "io/base/text.h"
#include "io/formats/face_triangles.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// Numbers after each other, in either order of bytes.
class Bytes
{
public:
    explicit Bytes(bool is_big_endian) : is_big_endian_(is_big_endian) {}

    void add(std::uint32_t word)
    {
        std::array<char, 4> bytes;
        for (unsigned k = 0; k < 4; ++k)
            bytes[is_big_endian_ ? 3 - k : k] = static_cast<char>(word >> (8 * k));
        text_.append(bytes.data(), bytes.size());
    }
    void add(float number) { add(std::bit_cast<std::uint32_t>(number)); }
    void add_text(std::string_view text) { text_ += text; }
    std::string take() { return std::exchange(text_, {}); }
    std::size_t size() const { return text_.size(); }

private:
    bool is_big_endian_;
    std::string text_;
};

std::uint32_t count_of(std::size_t count, const std::string& path, const char* what)
{
    if (count > 0x7fffffffu)
        throw Error(
            Fault::Usage,
            at({path, 0, ""}, "cannot hold " + std::to_string(count) + " " + what));
    return static_cast<std::uint32_t>(count);
}

float stored(double value, const std::string& path)
{
    const float number = static_cast<float>(value);
    if (!std::isfinite(number))
        throw malformed({path, 0, ""}, shortest(value) + " does not fit 32 bits");
    return number;
}

/// Models have colours in sRGB, glTF has shares of light: 16 bits keep dark steps apart.
/// [IEC 61966-2-1]
std::array<std::uint32_t, 256> linear_shares()
{
    std::array<std::uint32_t, 256> shares;
    for (std::size_t i = 0; i < shares.size(); ++i)
    {
        const double c = static_cast<double>(i) / 255.0;
        const double share =
            c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
        shares[i] = static_cast<std::uint32_t>(std::lround(65535.0 * share));
    }
    return shares;
}

} // namespace

class AnimationFile::Writer
{
public:
    virtual ~Writer() = default;
    virtual void add(const std::vector<Vector3d>& samples) = 0;
    virtual void finish() = 0;
};

class AnimationFile::PointCache final : public Writer
{
public:
    PointCache(const std::string& path, OutputSet& outputs, std::size_t points,
               const std::vector<double>& times, bool is_mdd)
        : path_(path), file_(outputs.add(path)), bytes_(is_mdd)
    {
        const std::uint32_t num_points = count_of(points, path, "points"),
                            num_frames = count_of(times.size(), path, "frames");
        if (is_mdd)
        {
            bytes_.add(num_frames);
            bytes_.add(num_points);
            for (const double time : times)
                bytes_.add(stored(time, path));
        }
        else
        {
            bytes_.add_text(std::string_view("POINTCACHE2\0", 12));
            bytes_.add(std::uint32_t(1));
            bytes_.add(num_points);
            bytes_.add(0.0f);
            bytes_.add(1.0f);
            bytes_.add(num_frames);
        }
    }
    void add(const std::vector<Vector3d>& samples) override
    {
        for (const Vector3d& x : samples)
        {
            for (const double value : x)
                bytes_.add(stored(value, path_));
            if (bytes_.size() >= kAtOnce)
                file_.write(bytes_.take());
        }
    }
    void finish() override { file_.write(bytes_.take()); }

private:
    static constexpr std::size_t kAtOnce = std::size_t(1) << 18;

    std::string path_;
    OutputFile& file_;
    Bytes bytes_;
};

class AnimationFile::Glb final : public Writer
{
public:
    Glb(const std::string& path, OutputSet& outputs, const Geometry& geometry,
        std::vector<double> times, NormalsOf normals,
        const std::vector<TextureCoordinate>& texture)
        : path_(path), outputs_(outputs), geometry_(geometry), times_(std::move(times)),
          normals_of_(std::move(normals)), targets_(folder_of(path == "-" ? "." : path))
    {
        check_output(path, outputs.overwrite());
        find_vertices(texture);
        count_of(vertices_.size(), path, "points");
        Vector3d low = Vector3d::Zero(), high = low;
        if (!geometry.samples.empty())
            low = high = geometry.samples.front();
        for (const Vector3d& x : geometry.samples)
        {
            low = low.cwiseMin(x);
            high = high.cwiseMax(x);
        }
        middle_ = 0.5 * (low + high);
        const double points = static_cast<double>(vertices_.size()),
                     frames = static_cast<double>(times_.size());
        const double bytes_of_a_point = normals_of_ ? 24.0 : 12.0;
        if (bytes_of_a_point * points * (frames + 1.0) + 4.0 * frames * frames > 4.0e9)
            throw too_large();
    }

    void add(const std::vector<Vector3d>& samples) override
    {
        if (is_still())
        {
            only_ = samples;
            return;
        }
        Bytes bytes(false);
        Bounds& bounds = bounds_.emplace_back();
        for (const std::uint32_t i : vertices_)
            add_vector(samples[i] - geometry_.samples[i], bytes, bounds);
        if (normals_of_)
        {
            if (rest_normals_.empty())
                rest_normals_ = normals_of_(geometry_.samples);
            Bounds unused;
            const std::vector<Vector3d> normals = normals_of_(samples);
            for (const std::uint32_t i : vertices_)
                add_vector(normals[i] - rest_normals_[i], bytes, unused);
        }
        const std::string text = bytes.take();
        targets_.append(text.data(), text.size());
    }

    void finish() override
    {
        Bytes head(false);
        Bounds mesh, unused;
        const std::vector<Vector3d>& places = is_still() ? only_ : geometry_.samples;
        for (const std::uint32_t i : vertices_)
            add_vector(places[i] - middle_, head, mesh);
        add_view(head, vertices_.size(), "VEC3", 5126, mesh.text());
        if (normals_of_)
        {
            const std::vector<Vector3d> normals = normals_of_(places);
            for (const std::uint32_t i : vertices_)
                add_vector(normals[i], head, unused);
            add_view(head, vertices_.size(), "VEC3", 5126, "");
        }
        const std::size_t colours = add_colours(head);
        const std::size_t texture = add_texture(head);
        const std::vector<Faces> faces = add_faces(head);
        if (is_still())
        {
            const std::uint64_t length = head.size();
            return write(json(colours, texture, faces, std::nullopt, length), head.take(),
                         length);
        }
        const std::size_t times = accessors_count_;
        for (const double time : times_)
            head.add(stored(time, path_));
        add_view(head, times_.size(), "SCALAR", 5126,
                 "\"min\":[" + short_of(times_.front()) + "],\"max\":[" +
                     short_of(times_.back()) + "]");
        for (std::size_t k = 0; k < times_.size(); ++k)
            for (std::size_t target = 0; target < times_.size(); ++target)
                head.add(target == k ? 1.0f : 0.0f);
        add_view(head, times_.size() * times_.size(), "SCALAR", 5126, "");
        const std::size_t first_target = accessors_count_;
        std::uint64_t end = head.size();
        const std::size_t count = vertices_.size();
        for (const Bounds& bounds : bounds_)
        {
            add_view_at(end, 12 * count, count, "VEC3", 5126, bounds.text());
            end += 12 * count;
            if (!normals_of_)
                continue;
            add_view_at(end, 12 * count, count, "VEC3", 5126, "");
            end += 12 * count;
        }
        write(json(colours, texture, faces, Movement{times, first_target}, end),
              head.take(), end);
    }

private:
    struct Bounds
    {
        Eigen::Array3f low = Eigen::Array3f::Constant(INFINITY);
        Eigen::Array3f high = Eigen::Array3f::Constant(-INFINITY);

        std::string text() const
        {
            const auto list = [](const Eigen::Array3f& v)
            { return short_of(v[0]) + "," + short_of(v[1]) + "," + short_of(v[2]); };
            return "\"min\":[" + list(low) + "],\"max\":[" + list(high) + "]";
        }
    };
    static constexpr std::size_t kNone = std::size_t(-1);
    /// Numbers of accessors; of the weights the one after the times.
    struct Movement
    {
        std::size_t times, first_target;
    };

    bool is_still() const { return times_.size() == 1; }
    static std::string short_of(double value) { return shortest(double(float(value))); }

    void add_vector(const Vector3d& x, Bytes& bytes, Bounds& bounds) const
    {
        for (Eigen::Index k = 0; k < 3; ++k)
        {
            const float number = stored(x[k], path_);
            bytes.add(number);
            bounds.low[k] = std::min(bounds.low[k], number);
            bounds.high[k] = std::max(bounds.high[k], number);
        }
    }
    void add_view_at(std::uint64_t start, std::uint64_t length, std::size_t count,
                     const char* type, int component, const std::string& more)
    {
        views_ += std::string(views_.empty() ? "" : ",") +
                  "{\"buffer\":0,\"byteOffset\":" + std::to_string(start) +
                  ",\"byteLength\":" + std::to_string(length) + "}";
        accessors_ += std::string(accessors_.empty() ? "" : ",") +
                      "{\"bufferView\":" + std::to_string(accessors_count_) +
                      ",\"componentType\":" + std::to_string(component) +
                      ",\"count\":" + std::to_string(count) + ",\"type\":\"" + type +
                      "\"" + (more.empty() ? "" : "," + more) + "}";
        ++accessors_count_;
    }
    /// Of all that was added to \p bytes since the last view.
    void add_view(const Bytes& bytes, std::size_t count, const char* type, int component,
                  const std::string& more)
    {
        add_view_at(viewed_, bytes.size() - viewed_, count, type, component, more);
        viewed_ = bytes.size();
    }
    std::size_t add_colours(Bytes& head)
    {
        if (geometry_.colours.empty())
            return kNone;
        const std::array<std::uint32_t, 256> linear = linear_shares();
        for (const std::uint32_t i : vertices_)
        {
            const std::array<std::uint8_t, 3>& colour = geometry_.colours[i];
            head.add(linear[colour[0]] | linear[colour[1]] << 16);
            head.add(linear[colour[2]] | std::uint32_t(65535) << 16);
        }
        add_view(head, vertices_.size(), "VEC4", 5123, "\"normalized\":true");
        return accessors_count_ - 1;
    }
    std::size_t add_texture(Bytes& head)
    {
        if (texture_.empty())
            return kNone;
        for (const TextureCoordinate& place : texture_)
            for (const float number : place)
                head.add(number);
        add_view(head, texture_.size(), "VEC2", 5126, "");
        return accessors_count_ - 1;
    }
    /// Faces of one group, in one accessor.
    struct Faces
    {
        std::string group;
        std::size_t indices;
    };
    /// Samples as corners show them: once for each of their texture coordinates.
    void find_vertices(const std::vector<TextureCoordinate>& texture)
    {
        const std::size_t count = geometry_.samples.size();
        if (texture.size() != geometry_.corners.size() || texture.empty())
        {
            vertices_.resize(count);
            std::iota(vertices_.begin(), vertices_.end(), 0u);
            return;
        }
        std::map<std::pair<std::uint32_t, TextureCoordinate>, std::uint32_t> known;
        std::vector<char> is_shown(count, 0);
        for (std::size_t c = 0; c < texture.size(); ++c)
        {
            const std::uint32_t sample = geometry_.corners[c];
            const auto [found, is_new] = known.try_emplace(
                {sample, texture[c]}, static_cast<std::uint32_t>(vertices_.size()));
            if (is_new)
            {
                vertices_.push_back(sample);
                texture_.push_back(texture[c]);
            }
            is_shown[sample] = 1;
            corner_vertices_.push_back(found->second);
        }
        for (std::uint32_t i = 0; i < count; ++i)
            if (!is_shown[i])
            {
                vertices_.push_back(i);
                texture_.push_back({0.0f, 0.0f});
            }
    }
    /// The vertex that shows \p sample in a face whose corners begin with \p first.
    std::uint32_t vertex_of(std::uint32_t sample, std::size_t first) const
    {
        if (corner_vertices_.empty())
            return sample;
        while (geometry_.corners[first] != sample)
            ++first;
        return corner_vertices_[first];
    }
    std::vector<Faces> add_faces(Bytes& head)
    {
        // Those of no group first, then groups as they first come.
        std::vector<std::string> names = {""};
        std::map<std::string, std::uint32_t> numbers = {{"", 0}};
        std::vector<std::uint32_t> group_of(geometry_.num_faces(), 0);
        for (const FaceGroup& group : geometry_.groups)
        {
            const auto [number, is_new] =
                numbers.try_emplace(group.name, static_cast<std::uint32_t>(names.size()));
            if (is_new)
                names.push_back(group.name);
            for (std::size_t f = group.first_face; f < group.end_face; ++f)
                group_of[f] = number->second;
        }
        std::vector<std::vector<std::size_t>> faces_of(names.size());
        for (std::size_t f = 0; f < group_of.size(); ++f)
            faces_of[group_of[f]].push_back(f);
        std::vector<Faces> all;
        FaceCutter cutter(geometry_);
        for (std::size_t group = 0; group < names.size(); ++group)
        {
            std::size_t count = 0;
            for (const std::size_t f : faces_of[group])
                for (const FaceCutter::Triangle& triangle : cutter.triangles(f))
                {
                    const std::size_t first = f == 0 ? 0 : geometry_.face_ends[f - 1];
                    for (const std::uint32_t corner : triangle)
                        head.add(vertex_of(corner, first));
                    count += 3;
                }
            if (count == 0)
                continue;
            add_view(head, count, "SCALAR", 5125, "");
            all.push_back({names[group], accessors_count_ - 1});
        }
        return all;
    }

    /// Places, and normals behind them, from an accessor on.
    std::string vectors_at(std::size_t accessor) const
    {
        std::string text = "{\"POSITION\":" + std::to_string(accessor);
        if (normals_of_)
            text += ",\"NORMAL\":" + std::to_string(accessor + 1);
        return text + "}";
    }

    std::string json(std::size_t colours, std::size_t texture,
                     const std::vector<Faces>& faces,
                     const std::optional<Movement>& movement, std::uint64_t length) const
    {
        std::string targets, weights, animations;
        if (movement)
        {
            for (std::size_t k = 0; k < times_.size(); ++k)
            {
                targets += (k ? "," : ",\"targets\":[") +
                           vectors_at(movement->first_target + (normals_of_ ? 2 * k : k));
                weights += k ? ",0" : ",\"weights\":[0";
            }
            targets += "]";
            weights += "]";
            animations =
                "\"animations\":[{\"name\":\"frames\",\"samplers\":[{\"input\":" +
                std::to_string(movement->times) +
                ",\"output\":" + std::to_string(movement->times + 1) +
                ",\"interpolation\":\"LINEAR\"}],\"channels\":[{\"sampler\":0,"
                "\"target\":{\"node\":0,\"path\":\"weights\"}}]}],";
        }
        std::string attributes = "{\"attributes\":" + vectors_at(0), materials,
                    primitives;
        attributes.pop_back();
        if (colours != kNone)
            attributes += ",\"COLOR_0\":" + std::to_string(colours);
        if (texture != kNone)
            attributes += ",\"TEXCOORD_0\":" + std::to_string(texture);
        attributes += "}";
        std::size_t num_materials = 0;
        for (const Faces& part : faces)
        {
            primitives += (primitives.empty() ? "" : ",") + attributes +
                          ",\"indices\":" + std::to_string(part.indices);
            if (!part.group.empty())
            {
                primitives += ",\"material\":" + std::to_string(num_materials++);
                materials += (materials.empty() ? "\"materials\":[" : ",") +
                             ("{\"name\":" + json_text(part.group) + "}");
            }
            primitives += targets + "}";
        }
        if (faces.empty())
            primitives = attributes + ",\"mode\":0" + targets + "}";
        if (!materials.empty())
            materials += "],";
        const std::string at = shortest(middle_.x()) + "," + shortest(middle_.y()) + "," +
                               shortest(middle_.z());
        return "{\"asset\":{\"version\":\"2.0\",\"generator\":\"cellwarp\"},"
               "\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
               "\"nodes\":[{\"name\":\"shape\",\"mesh\":0,\"translation\":[" +
               at + "]}],\"meshes\":[{\"primitives\":[" + primitives + "]" + weights +
               "}]," + materials + animations + "\"accessors\":[" + accessors_ +
               "],\"bufferViews\":[" + views_ +
               "],\"buffers\":[{\"byteLength\":" + std::to_string(length) + "}]}";
    }

    void write(std::string text, const std::string& head, std::uint64_t length)
    {
        while (text.size() % 4 != 0)
            text += ' ';
        if (!(static_cast<double>(length) + static_cast<double>(text.size()) < 4.2e9))
            throw too_large();
        OutputFile& file = outputs_.add(path_);
        Bytes start(false);
        start.add_text("glTF");
        start.add(std::uint32_t(2));
        start.add(static_cast<std::uint32_t>(28 + text.size() + length));
        start.add(static_cast<std::uint32_t>(text.size()));
        start.add_text("JSON");
        start.add_text(text);
        start.add(static_cast<std::uint32_t>(length));
        start.add_text(std::string_view("BIN\0", 4));
        file.write(start.take());
        file.write(head);
        std::string part;
        for (std::uint64_t at = 0; at < targets_.size(); at += part.size())
        {
            part.resize(static_cast<std::size_t>(
                std::min<std::uint64_t>(1 << 18, targets_.size() - at)));
            targets_.read(at, part.data(), part.size());
            file.write(part);
        }
    }

    Error too_large() const
    {
        return Error(
            Fault::Usage,
            at({path_, 0, ""}, "a .glb ends at 4 GB: use .pc2 or .mdd, or fewer frames"));
    }

    /// A text in quotes; what is no UTF-8 in it is replaced.
    static std::string json_text(const std::string& text)
    {
        return nlohmann::json(text).dump(-1, ' ', false,
                                         nlohmann::json::error_handler_t::replace);
    }

    std::string path_;
    OutputSet& outputs_;
    const Geometry& geometry_;
    std::vector<std::uint32_t> vertices_;        ///< the sample of each
    std::vector<std::uint32_t> corner_vertices_; ///< of each corner; empty: its sample
    std::vector<TextureCoordinate> texture_;     ///< of each vertex; empty: none
    const std::vector<double> times_;
    const NormalsOf normals_of_;
    std::vector<Vector3d> rest_normals_; ///< where it moves
    Vector3d middle_ = Vector3d::Zero();
    SpillFile targets_;
    std::vector<Vector3d> only_; ///< samples of the one frame of a mesh that is still
    std::vector<Bounds> bounds_; ///< of the targets
    std::string views_, accessors_;
    std::size_t accessors_count_ = 0, viewed_ = 0;
};

bool is_animation_format(std::string_view extension, std::string_view format,
                         bool is_patched)
{
    if (extension == "pc2" || extension == "mdd")
        return true;
    const bool is_gltf = format == "gltf" || format == "glb";
    return extension == "glb" && !(is_gltf && is_patched);
}

bool is_skinned(const Geometry& geometry)
{
    return std::find(geometry.attributes.begin(), geometry.attributes.end(),
                     "JOINTS_0") != geometry.attributes.end();
}

AnimationFile::AnimationFile(const std::string& path, OutputSet& outputs,
                             const Geometry& geometry, std::vector<double> times,
                             NormalsOf normals,
                             const std::vector<TextureCoordinate>& texture)
{
    const std::string extension = extension_of(path);
    if (extension == "glb")
        writer_ = std::make_unique<Glb>(path, outputs, geometry, std::move(times),
                                        std::move(normals), texture);
    else
        writer_ = std::make_unique<PointCache>(path, outputs, geometry.samples.size(),
                                               times, extension == "mdd");
}

AnimationFile::~AnimationFile() = default;

void AnimationFile::add(const std::vector<Vector3d>& samples)
{
    writer_->add(samples);
}

void AnimationFile::finish()
{
    writer_->finish();
}

} // namespace cellwarp::core
