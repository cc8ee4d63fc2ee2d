// SPDX-License-Identifier: GPL-3.0-or-later
// The scene: nodes, meshes and where they stand. Whatever the JSON claims is checked
// against bytes that are there before anything is taken from them or made for them.
#include "io/gltf.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "io/error.h"
#include "io/gltf_data.h"
#include "io/gltf_json.h"
#include "io/gltf_nodes.h"
#include "io/number.h"
#include "io/text.h"

namespace cellwarp
{

namespace
{

using Json = GltfJson::Json;

constexpr std::size_t kMaxInstances = 100000;
/// Samples, corners and uses of primitives that there may be beyond what the buffers
/// hold: instances of meshes, and primitives that share their bytes, could ask for far
/// more than the file is long.
constexpr std::uint64_t kMaxShared = 10000000;
/// What one byte of the buffers can hold: a strip of bytes has three corners for each.
constexpr std::uint64_t kMaxPerByte = 4;
constexpr double kSingular = 1e-12;

class GltfReader
{
public:
    /// As GltfData takes them.
    explicit GltfReader(GeometryFile& file, GltfPlan* plan = nullptr,
                        const InputFile* input = nullptr)
        : file_(file), out_(file.geometry), plan_(plan),
          data_(file, layout_, plan, input), json_(data_.json()), nodes_(json_)
    {
    }

    void read()
    {
        walk_nodes();
        finish();
        file_.gltf = std::make_shared<const GltfLayout>(std::move(layout_));
    }

private:
    // --- nodes -------------------------------------------------------------------------
    struct Visit
    {
        std::size_t node;
        std::size_t depth;
        Eigen::Affine3d to_world;
    };
    void find_meshes()
    {
        for (std::size_t i = 0; i < nodes_.size(); ++i)
            if (const Json* mesh = json_.find(nodes_[i], "mesh"))
                nodes_of_mesh_[json_.index_of(*mesh, element("nodes", i) + ".mesh",
                                              "meshes", json_.list("meshes").size())]
                    .push_back(i);
    }
    void walk_nodes()
    {
        find_meshes();
        read_meshes();
        std::vector<Visit> rest;
        for (auto root = nodes_.roots().rbegin(); root != nodes_.roots().rend(); ++root)
            rest.push_back({*root, 1, Eigen::Affine3d::Identity()});
        std::size_t instances = 0;
        while (!rest.empty())
        {
            const Visit visit = rest.back();
            rest.pop_back();
            const std::string where = element("nodes", visit.node);
            if (visit.depth > kMaxNodeNesting)
                json_.fail(where, "is nested deeper than 128 nodes");
            const Eigen::Affine3d to_world = visit.to_world * nodes_.matrix(visit.node);
            const std::vector<std::size_t>& children = nodes_.children(visit.node);
            for (auto child = children.rbegin(); child != children.rend(); ++child)
                rest.push_back({*child, visit.depth + 1, to_world});
            if (!nodes_[visit.node].contains("mesh"))
                continue;
            if (++instances > kMaxInstances)
                json_.fail(where, "more than 100000 nodes with meshes");
            instance(visit.node, to_world);
        }
    }

    // --- meshes ------------------------------------------------------------------------
    struct Primitive
    {
        std::size_t position = 0;
        std::optional<std::size_t> normal, tangent, indices;
        std::uint64_t mode = 4;
        std::string where;
    };
    std::optional<std::size_t> attribute(const Json& attributes, const char* name,
                                         std::size_t length,
                                         const std::string& where) const
    {
        const Json* found = json_.find(attributes, name);
        if (!found)
            return std::nullopt;
        const std::string field = where + ": " + name;
        const std::size_t number =
            json_.index_of(*found, field, "accessors", data_.accessors().size());
        const GltfAccessor& accessor = data_.accessors()[number];
        const bool may_be_whole = is_quantised_ && accessor.type != Scalar::UInt32;
        if (accessor.length != length ||
            (accessor.type != Scalar::Float32 && !may_be_whole))
            json_.fail(field, "accessors[" + std::to_string(number) + "] is no VEC" +
                                  std::to_string(length) + " of floats");
        return number;
    }
    void read_meshes()
    {
        const Json& meshes = json_.list("meshes");
        is_quantised_ = json_.uses("KHR_mesh_quantization");
        for (std::size_t m = 0; m < meshes.size(); ++m)
        {
            std::vector<Primitive>& primitives = meshes_.emplace_back();
            const Json* listed = json_.find(meshes[m], "primitives");
            if (!listed || !listed->is_array())
                json_.fail(element("meshes", m) + ".primitives", "need a list");
            for (std::size_t p = 0; p < listed->size(); ++p)
                primitives.push_back(read_primitive((*listed)[p], m,
                                                    element("meshes", m) + "." +
                                                        element("primitives", p)));
        }
    }
    Primitive read_primitive(const Json& object, std::size_t mesh,
                             const std::string& where)
    {
        Primitive primitive;
        primitive.where = where;
        const Json* attributes =
            object.is_object() ? json_.find(object, "attributes") : nullptr;
        if (!attributes || !attributes->is_object())
            json_.fail(where + ".attributes", "need an object");
        const auto position = attribute(*attributes, "POSITION", 3, where);
        if (!position)
            json_.fail(where, "has no POSITION");
        primitive.position = *position;
        primitive.normal = attribute(*attributes, "NORMAL", 3, where);
        primitive.tangent = attribute(*attributes, "TANGENT", 4, where);
        for (const auto& other : {primitive.normal, primitive.tangent})
            if (other && data_.accessors()[*other].count !=
                             data_.accessors()[primitive.position].count)
                json_.fail(where, "its attributes differ in count (accessors[" +
                                      std::to_string(*other) + "] and accessors[" +
                                      std::to_string(primitive.position) + "])");
        if (const Json* indices = json_.find(object, "indices"))
        {
            primitive.indices = json_.index_of(*indices, where + ".indices", "accessors",
                                               data_.accessors().size());
            const GltfAccessor& accessor = data_.accessors()[*primitive.indices];
            if (accessor.length != 1 ||
                (accessor.type != Scalar::UInt8 && accessor.type != Scalar::UInt16 &&
                 accessor.type != Scalar::UInt32))
                json_.fail(where + ".indices", "accessors[" +
                                                   std::to_string(*primitive.indices) +
                                                   "] is no SCALAR of unsigned integers");
        }
        primitive.mode = json_.count_of(object, "mode", where, 4);
        if (primitive.mode > 6)
            json_.fail(where + ".mode",
                       "got " + std::to_string(primitive.mode) + ", need 0 to 6");
        if (json_.extension(object, "KHR_draco_mesh_compression"))
        {
            if (!data_.accessors()[primitive.position].has_data)
                json_.fail(where, "KHR_draco_mesh_compression cannot be read");
            reason_of_mesh_.try_emplace(mesh, "a primitive is also compressed by Draco");
        }
        if (object.contains("targets"))
            reason_of_mesh_.try_emplace(mesh, "its mesh has morph targets");
        for (const auto& [name, value] : attributes->items())
            if (name != "POSITION")
                attribute_names_.insert(name == "NORMAL"    ? "normals"
                                        : name == "TANGENT" ? "tangents"
                                                            : name);
        for (const auto& used :
             {std::optional(primitive.position), primitive.normal, primitive.tangent})
            if (used)
            {
                users_[*used].insert(mesh);
                if (!data_.accessors()[*used].is_plain())
                    reason_of_mesh_.try_emplace(
                        mesh, "accessors[" + std::to_string(*used) +
                                  "] is sparse, compressed or not stored as floats");
            }
        return primitive;
    }
    void refuse_writing(std::size_t node, const std::string& why)
    {
        if (!out_.not_writable.empty())
            return;
        const Json* name = json_.find(json_.list("nodes")[node], "name");
        out_.not_writable = element("nodes", node);
        if (name && name->is_string())
            out_.not_writable += " " + in_quotes(name->get<std::string>());
        out_.not_writable += ": " + why;
    }
    /// What of this node's mesh is not the node's alone, or not stored as it is.
    void check_writable(std::size_t node, std::size_t mesh, const Eigen::Matrix3d& linear)
    {
        const Json& object = json_.list("nodes")[node];
        const std::vector<std::size_t>& same = nodes_of_mesh_[mesh];
        if (same.size() > 1)
            refuse_writing(node, "its mesh has several instances (also " +
                                     element("nodes", same[same[0] == node]) + ")");
        if (json_.extension(object, "EXT_mesh_gpu_instancing"))
            refuse_writing(node, "its mesh has several instances (on the GPU)");
        if (object.contains("skin"))
            refuse_writing(node, "its mesh has a skin");
        if (const auto reason = reason_of_mesh_.find(mesh);
            reason != reason_of_mesh_.end())
            refuse_writing(node, reason->second);
        for (const Primitive& primitive : meshes_[mesh])
            for (const auto& used :
                 {std::optional(primitive.position), primitive.normal, primitive.tangent})
                if (used && users_[*used].size() > 1)
                    refuse_writing(node, "accessors[" + std::to_string(*used) +
                                             "] is used by several meshes");
        if (!Eigen::FullPivLU<Eigen::Matrix3d>(linear)
                 .setThreshold(kSingular)
                 .isInvertible())
            refuse_writing(node, "its matrix is singular");
    }

    static void add_places(const GltfAccessor& accessor, std::size_t element_number,
                           ByteOffsets& places)
    {
        for (std::size_t k = 0; k < 3; ++k)
            places.starts.push_back(accessor.start + element_number * accessor.stride +
                                    k * sizeof(float));
    }
    /// Directions or tangents of samples from \p first_sample on.
    void add_vectors(std::size_t number, std::size_t first_sample,
                     const Eigen::Matrix3d& map, std::vector<Eigen::Vector3d>& vectors,
                     std::vector<std::uint32_t>& samples, ByteOffsets& places)
    {
        count_up(num_vectors_, data_.accessors()[number].count, "normals and tangents");
        const std::vector<Eigen::Vector3d> values = data_.values_of(number);
        for (std::size_t i = 0; i < values.size(); ++i)
        {
            // One that is none stays as it is: it takes no part.
            const Eigen::Vector3d vector = turned_to_world(map, values[i]);
            if (!vector.allFinite() || vector.isZero(0))
            {
                num_bad_vectors_ += values[i].allFinite() ? 0 : 1;
                continue;
            }
            vectors.push_back(vector);
            samples.push_back(static_cast<std::uint32_t>(first_sample + i));
            if (data_.accessors()[number].is_plain())
                add_places(data_.accessors()[number], i, places);
        }
        note_data(number);
    }
    GltfLayout::Data data_of(std::size_t number) const
    {
        const GltfAccessor& accessor = data_.accessors()[number];
        return {number, accessor.start, accessor.stride, accessor.count, accessor.length};
    }
    void note_data(std::size_t number)
    {
        if (data_.accessors()[number].is_plain())
            layout_.data.push_back(data_of(number));
    }
    /// The first of them; with a plan, the run that they are.
    std::size_t add_samples(std::size_t number, const GltfLayout::Part& part)
    {
        const std::size_t first = static_cast<std::size_t>(num_samples_);
        const GltfAccessor& accessor = data_.accessors()[number];
        data_.check_zeros(number);
        count_up(num_samples_, accessor.count, "samples");
        if (plan_)
        {
            plan_->runs.push_back({data_of(number), {}, {}, layout_.parts.size()});
            note_data(number);
            return plan_->runs.size() - 1;
        }
        const std::vector<Eigen::Vector3d> values = data_.values_of(number);
        for (std::size_t i = 0; i < values.size(); ++i)
        {
            const Eigen::Vector3d world =
                part.is_in_place() ? values[i]
                                   : Eigen::Vector3d(part.to_world * values[i]);
            if (!world.allFinite())
                throw vertex_not_finite(file_.path, data_of(number), i);
            out_.samples.push_back(world);
            if (accessor.is_plain())
                add_places(accessor, i, out_.sample_places);
        }
        note_data(number);
        return first;
    }
    /// Counts what there may not be much more of than the buffers have bytes.
    void count_up(std::uint64_t& total, std::uint64_t more, const char* what) const
    {
        const std::uint64_t most = kMaxPerByte * data_.body_bytes() + kMaxShared;
        if (more > most || total > most - more)
            json_.fail("nodes",
                       "more " + std::string(what) + " than " + std::to_string(most) +
                           ": meshes, or primitives that share their data, stand "
                           "there too often");
        total += more;
    }
    void add_to_run(std::size_t number, std::vector<GltfLayout::Data>& list)
    {
        count_up(num_vectors_, data_.accessors()[number].count, "normals and tangents");
        list.push_back(data_of(number));
        note_data(number);
    }
    void instance(std::size_t node, const Eigen::Affine3d& node_to_world)
    {
        const Json& object = json_.list("nodes")[node];
        const std::size_t mesh = static_cast<std::size_t>(object["mesh"].get<double>());
        GltfLayout::Part part;
        // A skin places its mesh by its joints alone: what is stored is the bind pose.
        const Eigen::Affine3d to_world =
            object.contains("skin") ? Eigen::Affine3d::Identity() : node_to_world;
        part.to_world = to_world;
        const Eigen::Matrix3d linear = to_world.linear();
        check_writable(node, mesh, linear);
        const Eigen::FullPivLU<Eigen::Matrix3d> inverse(linear);
        if (!linear.isIdentity(0) && inverse.isInvertible())
            part.of_normals = inverse.inverse().transpose();
        part.first[0] = out_.samples.size();
        part.first[1] = out_.directions.size();
        part.first[2] = out_.tangents.size();
        // Primitives of one mesh may share what they are made of.
        std::map<std::size_t, std::size_t> first_samples;
        std::set<std::pair<std::size_t, std::size_t>> known;
        for (const Primitive& primitive : meshes_[mesh])
        {
            const auto [samples, is_new] =
                first_samples.try_emplace(primitive.position, 0);
            if (is_new)
                samples->second = add_samples(primitive.position, part);
            const bool has_normals =
                primitive.normal &&
                known.emplace(primitive.position, *primitive.normal).second;
            const bool has_tangents =
                primitive.tangent &&
                known.emplace(primitive.position, *primitive.tangent).second;
            if (has_normals && plan_)
                add_to_run(*primitive.normal, plan_->runs[samples->second].directions);
            else if (has_normals)
                add_vectors(*primitive.normal, samples->second, part.of_normals,
                            out_.directions, out_.direction_samples,
                            out_.direction_places);
            if (has_tangents && plan_)
                add_to_run(*primitive.tangent, plan_->runs[samples->second].tangents);
            else if (has_tangents)
                add_vectors(*primitive.tangent, samples->second, part.to_world.linear(),
                            out_.tangents, out_.tangent_samples, out_.tangent_places);
            add_faces(primitive, samples->second);
        }
        part.end[0] = out_.samples.size();
        part.end[1] = out_.directions.size();
        part.end[2] = out_.tangents.size();
        layout_.parts.push_back(part);
    }
    void add_faces(const Primitive& primitive, std::size_t first_sample)
    {
        const std::uint64_t samples = data_.accessors()[primitive.position].count;
        const std::uint64_t count =
            primitive.indices ? data_.accessors()[*primitive.indices].count : samples;
        count_up(num_corners_,
                 primitive.mode < 5 || count < 3 ? count + 1 : 3 * (count - 2),
                 "corners of faces");
        std::vector<Eigen::Vector3d> indices;
        if (primitive.indices && !plan_)
        {
            indices = data_.values_of(*primitive.indices);
            for (std::size_t i = 0; i < indices.size(); ++i)
                if (indices[i].x() >= static_cast<double>(samples))
                    throw index_out_of_range(file_.path, primitive.where, i,
                                             indices[i].x(), samples);
        }
        if (primitive.indices && plan_)
            plan_->indices.push_back({data_of(*primitive.indices),
                                      data_.accessors()[*primitive.indices].type, samples,
                                      primitive.where});
        if (primitive.mode < 4)
            return;
        if (primitive.mode == 4 ? count % 3 != 0 : count < 3)
            json_.fail(primitive.where + ".indices",
                       "got " + std::to_string(count) + " corners, need " +
                           (primitive.mode == 4 ? "a multiple of 3" : "at least 3"));
        if (plan_)
            return;
        const auto corner = [&](std::uint64_t i)
        {
            const std::size_t at = static_cast<std::size_t>(i);
            return static_cast<std::uint32_t>(
                first_sample +
                (primitive.indices ? static_cast<std::size_t>(indices[at].x()) : at));
        };
        const std::uint64_t faces = primitive.mode == 4 ? count / 3 : count - 2;
        for (std::uint64_t f = 0; f < faces; ++f)
        {
            // Triangles, a strip (every other one is turned over), or a fan.
            const std::uint64_t odd = f % 2;
            const std::array<std::uint64_t, 3> which =
                primitive.mode == 4   ? std::array{3 * f, 3 * f + 1, 3 * f + 2}
                : primitive.mode == 5 ? std::array{f, f + 1 + odd, f + 2 - odd}
                                      : std::array{f + 1, f + 2, std::uint64_t(0)};
            for (const std::uint64_t i : which)
                out_.corners.push_back(corner(i));
            out_.face_ends.push_back(out_.corners.size());
        }
    }

    // --- the end -----------------------------------------------------------------------
    void finish()
    {
        if (num_samples_ == 0)
            json_.fail("", "no vertices in its scene");
        out_.sample_places.scalars.fill(Scalar::Float32);
        out_.direction_places.scalars.fill(Scalar::Float32);
        out_.tangent_places.scalars.fill(Scalar::Float32);
        const auto by_accessor = [](const GltfLayout::Data& a, const GltfLayout::Data& b)
        { return a.accessor < b.accessor; };
        std::sort(layout_.data.begin(), layout_.data.end(), by_accessor);
        layout_.data.erase(
            std::unique(layout_.data.begin(), layout_.data.end(),
                        [](const GltfLayout::Data& a, const GltfLayout::Data& b)
                        { return a.accessor == b.accessor; }),
            layout_.data.end());
        if (out_.not_writable.empty())
        {
            std::set<std::size_t> changing;
            for (const GltfLayout::Data& data : layout_.data)
                changing.insert(data.accessor);
            out_.not_writable = data_.overlap(changing);
        }
        if (!out_.not_writable.empty())
            for (ByteOffsets* places :
                 {&out_.sample_places, &out_.direction_places, &out_.tangent_places})
                places->starts.clear();
        out_.attributes.assign(attribute_names_.begin(), attribute_names_.end());
        warn_of_bad_vectors(file_.path, num_bad_vectors_, out_);
    }

    GeometryFile& file_;
    Geometry& out_;
    GltfPlan* plan_;
    GltfLayout layout_;
    GltfData data_;
    const GltfJson& json_;
    const GltfNodes nodes_;
    std::vector<std::vector<Primitive>> meshes_;
    std::map<std::size_t, std::vector<std::size_t>> nodes_of_mesh_;
    std::map<std::size_t, std::set<std::size_t>> users_; ///< meshes of each accessor
    std::map<std::size_t, std::string> reason_of_mesh_;  ///< that it is not writable
    std::set<std::string> attribute_names_;
    bool is_quantised_ = false; ///< positions and the like may be stored as integers
    std::uint64_t num_bad_vectors_ = 0;
    std::uint64_t num_samples_ = 0, num_vectors_ = 0, num_corners_ = 0;
};

} // namespace

Eigen::Vector3d turned_to_world(const Eigen::Matrix3d& map, const Eigen::Vector3d& vector)
{
    if (map.isIdentity(0))
        return vector;
    const Eigen::Vector3d turned = map * vector;
    const double length = turned.norm();
    return length > 0 ? Eigen::Vector3d(turned * (vector.norm() / length)) : vector;
}

Error vertex_not_finite(const std::string& path, const GltfLayout::Data& data,
                        std::uint64_t i)
{
    return malformed({path, 0,
                      element("accessors", data.accessor) + ": vertex " +
                          std::to_string(i) + " (byte " +
                          std::to_string(data.start + i * data.stride) +
                          " of the buffers)"},
                     "is not finite");
}

Error index_out_of_range(const std::string& path, const std::string& primitive,
                         std::uint64_t i, double index, std::uint64_t samples)
{
    return malformed({path, 0, primitive + ".indices"},
                     "index " + std::to_string(i) + " is out of range (got " +
                         shortest(index) + ", need 0 to " + std::to_string(samples - 1) +
                         ")");
}

void warn_of_bad_vectors(const std::string& path, std::uint64_t count, Geometry& out)
{
    if (count > 0)
        out.warnings.push_back(
            at({path, 0, ""}, std::to_string(count) +
                                  " normals or tangents are not finite and stay as "
                                  "they are"));
}

void scan_gltf(GeometryFile& file)
{
    GltfReader(file).read();
}

GltfPlan plan_gltf(GeometryFile& file, const InputFile& input)
{
    GltfPlan plan;
    GltfReader(file, &plan, &input).read();
    return plan;
}

} // namespace cellwarp
