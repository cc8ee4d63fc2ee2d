// SPDX-License-Identifier: GPL-3.0-or-later
// The scene: nodes, meshes and where they stand. Whatever the JSON claims is checked
// against bytes that are there before anything is taken from them or made for them.
#include "io/formats/gltf.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/formats/gltf_data.h"
#include "io/formats/gltf_json.h"
#include "io/formats/gltf_nodes.h"

namespace cellwarp::core
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
        // Unpacked data are in memory as a whole: they have no plan.
        layout_.is_patched = !layout_.is_packed && !has_gpu_instances();
        if (!plan_ || layout_.is_patched)
        {
            walk_nodes();
            finish();
        }
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
    bool has_gpu_instances() const
    {
        const Json& nodes = json_.list("nodes");
        return std::any_of(nodes.begin(), nodes.end(),
                           [](const Json& node) {
                               return node.contains("mesh") &&
                                      GltfJson::extension(node, kInstancingExtension);
                           });
    }
    void check_meshes()
    {
        for (std::size_t i = 0; i < nodes_.size(); ++i)
            if (const Json* mesh = json_.find(nodes_[i], "mesh"))
                json_.index_of(*mesh, element("nodes", i) + ".mesh", "meshes",
                               json_.list("meshes").size());
    }
    void walk_nodes()
    {
        check_meshes();
        read_meshes();
        layout_.uses.assign(data_.accessors().size(), 0);
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
            const auto count = [&](std::size_t more)
            {
                if (more > kMaxInstances - instances)
                    json_.fail(where, "more than 100000 nodes with meshes");
                instances += more;
            };
            const Json* const many =
                json_.extension(nodes_[visit.node], kInstancingExtension);
            if (!many)
            {
                count(1);
                instance(visit.node, to_world);
                continue;
            }
            const std::vector<Eigen::Affine3d> places =
                gpu_places(*many, where + ".extensions." + kInstancingExtension, count);
            for (std::size_t k = 0; k < places.size(); ++k)
                instance(visit.node, to_world * places[k], k);
        }
    }
    /// Places in the node of the instances of its mesh.
    template <class Count>
    std::vector<Eigen::Affine3d> gpu_places(const Json& many, const std::string& where,
                                            Count&& count) const
    {
        const Json* const attributes =
            many.is_object() ? json_.find(many, "attributes") : nullptr;
        if (!attributes || !attributes->is_object())
            json_.fail(where + ".attributes", "need an object");
        std::optional<std::size_t> size;
        const auto numbers = [&](const char* name, std::size_t length)
        {
            const Json* const found = json_.find(*attributes, name);
            if (!found)
                return std::vector<double>();
            const std::string field = where + ": " + name;
            const std::size_t number =
                json_.index_of(*found, field, "accessors", data_.accessors().size());
            const GltfAccessor& accessor = data_.accessors()[number];
            if (accessor.length != length)
                json_.fail(field, "accessors[" + std::to_string(number) + "] is no VEC" +
                                      std::to_string(length));
            if (size.value_or(accessor.count) != accessor.count)
                json_.fail(where, "its attributes differ in count");
            if (!size)
                count(static_cast<std::size_t>(accessor.count));
            size = static_cast<std::size_t>(accessor.count);
            return data_.numbers_of(number);
        };
        const std::vector<double> shifts = numbers("TRANSLATION", 3),
                                  turns = numbers("ROTATION", 4),
                                  scales = numbers("SCALE", 3);
        if (!size)
            json_.fail(where + ".attributes", "need TRANSLATION, ROTATION or SCALE");
        std::vector<Eigen::Affine3d> places(*size, Eigen::Affine3d::Identity());
        for (std::size_t k = 0; k < places.size(); ++k)
        {
            if (!shifts.empty())
                places[k].translate(Eigen::Map<const Eigen::Vector3d>(&shifts[3 * k]));
            if (!turns.empty())
            {
                const Eigen::Quaterniond turn(&turns[4 * k]);
                if (!(turn.norm() > 0) || !std::isfinite(turn.norm()))
                    json_.fail(where + ": ROTATION",
                               "element " + std::to_string(k) + " is no rotation");
                places[k].rotate(turn.normalized());
            }
            if (!scales.empty())
                places[k].scale(Eigen::Map<const Eigen::Vector3d>(&scales[3 * k]));
        }
        return places;
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
        if (object.contains("targets"))
            reason_of_mesh_.try_emplace(mesh, "its mesh has morph targets");
        for (const auto& [name, value] : attributes->items())
            if (name != "POSITION")
                attribute_names_.insert(name == "NORMAL"    ? "normals"
                                        : name == "TANGENT" ? "tangents"
                                                            : name);
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
    void check_writable(std::size_t node, std::size_t mesh, const Eigen::Matrix3d& linear)
    {
        if (const auto reason = reason_of_mesh_.find(mesh);
            reason != reason_of_mesh_.end())
            refuse_writing(node, reason->second);
        if (!Eigen::FullPivLU<Eigen::Matrix3d>(linear)
                 .setThreshold(kSingular)
                 .isInvertible())
            refuse_writing(node, "its matrix is singular");
    }

    /// Directions or tangents of samples from \p first_sample on.
    void add_vectors(std::size_t number, std::size_t first_sample,
                     const Eigen::Matrix3d& map, std::vector<Eigen::Vector3d>& vectors,
                     std::vector<std::uint32_t>& samples)
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
    void instance(std::size_t node, const Eigen::Affine3d& node_to_world,
                  std::optional<std::size_t> gpu_instance = {})
    {
        const Json& object = json_.list("nodes")[node];
        GltfLayout::Part part;
        part.node = node;
        part.mesh = static_cast<std::size_t>(object["mesh"].get<double>());
        part.gpu_instance = gpu_instance;
        // A skin places its mesh by its joints alone: what is stored is the bind pose.
        const Eigen::Affine3d to_world =
            object.contains("skin") ? Eigen::Affine3d::Identity() : node_to_world;
        part.to_world = to_world;
        const Eigen::Matrix3d linear = to_world.linear();
        check_writable(node, part.mesh, linear);
        const Eigen::FullPivLU<Eigen::Matrix3d> inverse(linear);
        if (!linear.isIdentity(0) && inverse.isInvertible())
            part.of_normals = inverse.inverse().transpose();
        // Primitives of one mesh may share what they are made of.
        std::map<std::size_t, std::size_t> first_samples;
        std::set<std::pair<std::size_t, std::size_t>> known;
        for (const Primitive& primitive : meshes_[part.mesh])
        {
            const auto [samples, is_new] =
                first_samples.try_emplace(primitive.position, 0);
            GltfLayout::Run run;
            run.position = primitive.position;
            const auto add_run = [&](std::size_t list, std::size_t accessor,
                                     std::size_t first, std::size_t end)
            {
                run.list = list;
                run.accessor = accessor;
                run.first = first;
                run.end = end;
                run.samples = samples->second;
                part.runs.push_back(run);
                ++layout_.uses[accessor];
            };
            if (is_new)
            {
                samples->second = add_samples(primitive.position, part);
                add_run(0, primitive.position, samples->second, out_.samples.size());
            }
            const auto is_first = [&](const std::optional<std::size_t>& accessor)
            { return accessor && known.emplace(primitive.position, *accessor).second; };
            if (is_first(primitive.normal))
            {
                const std::size_t first = out_.directions.size();
                if (plan_)
                    add_to_run(*primitive.normal,
                               plan_->runs[samples->second].directions);
                else
                    add_vectors(*primitive.normal, samples->second, part.of_normals,
                                out_.directions, out_.direction_samples);
                add_run(1, *primitive.normal, first, out_.directions.size());
            }
            if (is_first(primitive.tangent))
            {
                const std::size_t first = out_.tangents.size();
                if (plan_)
                    add_to_run(*primitive.tangent, plan_->runs[samples->second].tangents);
                else
                    add_vectors(*primitive.tangent, samples->second,
                                part.to_world.linear(), out_.tangents,
                                out_.tangent_samples);
                add_run(2, *primitive.tangent, first, out_.tangents.size());
            }
            add_faces(primitive, samples->second);
        }
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
        const auto by_accessor = [](const GltfLayout::Data& a, const GltfLayout::Data& b)
        { return a.accessor < b.accessor; };
        std::sort(layout_.data.begin(), layout_.data.end(), by_accessor);
        layout_.data.erase(
            std::unique(layout_.data.begin(), layout_.data.end(),
                        [](const GltfLayout::Data& a, const GltfLayout::Data& b)
                        { return a.accessor == b.accessor; }),
            layout_.data.end());
        find_own();
        if (layout_.is_packed)
            out_.warnings.push_back(at({file_.path, 0, ""},
                                       "holds compressed data, which are written "
                                       "uncompressed where the model has moved"));
        out_.attributes.assign(attribute_names_.begin(), attribute_names_.end());
        warn_of_bad_vectors(file_.path, num_bad_vectors_, out_);
    }

    /// Which accessors hold the numbers of one run and of nothing else.
    void find_own()
    {
        count_other_uses();
        std::set<std::size_t> changing;
        for (const GltfLayout::Data& data : layout_.data)
            changing.insert(data.accessor);
        layout_.does_overlap = data_.do_overlap(changing);
        for (const GltfLayout::Part& part : layout_.parts)
            for (const GltfLayout::Run& run : part.runs)
                layout_.is_patched = layout_.is_patched && layout_.is_own(run.accessor);
    }
    /// Counts the other readers of accessors that runs read, inside and outside of the
    /// scene.
    void count_other_uses()
    {
        std::set<std::size_t> nodes, shown, hidden; // the latter two of meshes
        for (const GltfLayout::Part& part : layout_.parts)
        {
            nodes.insert(part.node);
            shown.insert(part.mesh);
        }
        for (std::size_t i = 0; i < nodes_.size(); ++i)
            if (const Json* mesh = json_.find(nodes_[i], "mesh");
                mesh && !nodes.contains(i))
                hidden.insert(static_cast<std::size_t>(mesh->get<double>()));
        const auto count = [&](const Json& value)
        {
            if (!value.is_number() || !(value.get<double>() >= 0))
                return;
            const std::size_t accessor = static_cast<std::size_t>(value.get<double>());
            if (accessor < layout_.uses.size() && layout_.uses[accessor] > 0)
                ++layout_.uses[accessor];
        };
        const auto count_all = [&](const Json& object)
        {
            for (const auto& [name, value] : object.items())
                count(value);
        };
        const Json& meshes = json_.list("meshes");
        for (std::size_t m = 0; m < meshes.size(); ++m)
            for (const Json& primitive : meshes[m]["primitives"])
            {
                const bool is_counted = shown.contains(m) && !hidden.contains(m);
                for (const auto& [name, value] : primitive["attributes"].items())
                    if (!is_counted ||
                        (name != "POSITION" && name != "NORMAL" && name != "TANGENT"))
                        count(value);
                if (const Json* indices = json_.find(primitive, "indices"))
                    count(*indices);
                if (const Json* targets = json_.find(primitive, "targets");
                    targets && targets->is_array())
                    std::for_each(targets->begin(), targets->end(), count_all);
            }
        for (std::size_t i = 0; i < nodes_.size(); ++i)
            if (const Json* many = json_.extension(nodes_[i], kInstancingExtension))
                if (const Json* all = json_.find(*many, "attributes");
                    all && all->is_object())
                    count_all(*all);
        for (const Json& skin : json_.list("skins"))
            if (const Json* bind = json_.find(skin, "inverseBindMatrices"))
                count(*bind);
        for (const Json& animation : json_.list("animations"))
            if (const Json* samplers = json_.find(animation, "samplers");
                samplers && samplers->is_array())
                std::for_each(samplers->begin(), samplers->end(), count_all);
    }

    GeometryFile& file_;
    Geometry& out_;
    GltfPlan* plan_;
    GltfLayout layout_;
    GltfData data_;
    const GltfJson& json_;
    const GltfNodes nodes_;
    std::vector<std::vector<Primitive>> meshes_;
    std::map<std::size_t, std::string> reason_of_mesh_; ///< that it is not writable
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

} // namespace cellwarp::core
