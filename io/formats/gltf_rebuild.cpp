// SPDX-License-Identifier: GPL-3.0-or-later
// All new bytes go to the end of one of the file's buffers, the home, so that the result
// has no other files beside it than the model. Bytes of a buffer that only compressed
// data used are left out. Numbers of accessors, meshes and nodes that are there stay:
// what is new comes after them, so that whatever names them goes on being right.
#include "io/formats/gltf_rebuild.h"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>

#include "io/base/base64.h"
#include "io/base/error.h"
#include "io/formats/gltf_json.h"
#include "io/formats/stored_number.h"

namespace cellwarp::core
{

namespace
{

using OrderedJson = nlohmann::ordered_json;
using Kind = GltfLayout::Buffer::Kind;

/// Views begin at multiples of this: no number of a glTF is longer.
constexpr std::size_t kAlignment = 8;

std::size_t index_in(const OrderedJson& value)
{
    return static_cast<std::size_t>(value.get<double>());
}

const OrderedJson* extension_in(const OrderedJson& object, const char* name)
{
    const auto all = object.find("extensions");
    if (all == object.end() || !all->is_object())
        return nullptr;
    const auto found = all->find(name);
    return found == all->end() ? nullptr : &*found;
}

void erase_extension(OrderedJson& object, const char* name)
{
    const auto all = object.find("extensions");
    if (all == object.end() || !all->is_object())
        return;
    all->erase(name);
    if (all->empty())
        object.erase("extensions");
}

void align(std::string& bytes, std::size_t to = kAlignment)
{
    bytes.resize((bytes.size() + to - 1) / to * to, '\0');
}

/// Stretches of the unpacked buffers that are left out.
class Cuts
{
public:
    /// Stretches that some \p packed have and none that is \p live; of the buffer that
    /// begins at \p start. [byte]
    void add(std::vector<std::pair<std::uint64_t, int>>& edges, std::uint64_t start)
    {
        std::sort(edges.begin(), edges.end());
        std::int64_t packed = 0, live = 0;
        for (std::size_t i = 0; i < edges.size(); ++i)
        {
            const auto& [place, change] = edges[i];
            (change == kPackedBegins || change == kPackedEnds ? packed : live) +=
                change == kPackedBegins || change == kLiveBegins ? 1 : -1;
            if (packed == 0 || live > 0 || i + 1 == edges.size())
                continue;
            // The remaining bytes keep their alignment.
            const std::uint64_t begin =
                start + (place - start + kAlignment - 1) / kAlignment * kAlignment;
            const std::uint64_t end =
                start + (edges[i + 1].first - start) / kAlignment * kAlignment;
            if (begin >= end)
                continue;
            cut_ += end - begin;
            cuts_.push_back({begin, end, cut_});
        }
    }
    static constexpr int kPackedBegins = 0, kLiveBegins = 1, kPackedEnds = 2,
                         kLiveEnds = 3;

    /// How many bytes before \p place are left out.
    std::uint64_t before(std::uint64_t place) const
    {
        const auto next = std::upper_bound(cuts_.begin(), cuts_.end(), place,
                                           [](std::uint64_t at, const Cut& cut)
                                           { return at < cut.end; });
        return next == cuts_.begin() ? 0 : (next - 1)->sum;
    }
    /// [start, end) of \p body without them.
    std::string rest(std::string_view body, std::uint64_t start, std::uint64_t end) const
    {
        std::string out;
        std::uint64_t at = start;
        for (const Cut& cut : cuts_)
            if (cut.begin >= start && cut.end <= end)
            {
                out += body.substr(at, cut.begin - at);
                at = cut.end;
            }
        out += body.substr(at, end - at);
        return out;
    }

private:
    struct Cut
    {
        std::uint64_t begin, end, sum; ///< sum: with all before it
    };
    std::vector<Cut> cuts_;
    std::uint64_t cut_ = 0;
};

class Rebuild
{
public:
    Rebuild(const GeometryFile& file, std::string body,
            const std::vector<MovedRun>& moved)
        : file_(file), layout_(*file.gltf), body_(std::move(body)), moved_(moved),
          root_(OrderedJson::parse(
              std::string_view(file.bytes)
                  .substr(layout_.json.begin, layout_.json.end - layout_.json.begin))),
          meshes_before_(root_["meshes"])
    {
        for (std::size_t b = layout_.buffers.size(); b-- > 0;)
            if (const Kind kind = layout_.buffers[b].kind;
                kind == Kind::Inside || kind == Kind::Beside || kind == Kind::Chunk)
                home_ = b;
        if (!home_)
            throw malformed({file.path, 0, ""},
                            "cannot be written: no buffer holds its data");
    }

    PatchedGltf run(const std::vector<GltfBounds>& bounds, const std::string& output)
    {
        find_draco();
        cut_buffers();
        for (const GltfBounds& found : bounds)
            set_bounds(found, root_["accessors"][found.accessor()], false);
        place_views();
        move();
        unpack_draco();
        forget_extensions();
        return assembled(output);
    }

private:
    OrderedJson& mesh(std::size_t m) { return root_["meshes"][m]; }

    // --- what was compressed
    // ----------------------------------------------------------------
    /// Views that Draco's data stand in, and nothing else uses.
    void find_draco()
    {
        for (const OrderedJson& found : root_["meshes"])
            for (const OrderedJson& primitive : found["primitives"])
                if (const OrderedJson* packed = extension_in(primitive, kDracoExtension))
                    note_draco_view(*packed);
        const auto keep = [&](const OrderedJson& object)
        {
            if (object.contains("bufferView") && object["bufferView"].is_number())
                draco_views_.erase(index_in(object["bufferView"]));
        };
        if (root_.contains("images") && root_["images"].is_array())
            std::for_each(root_["images"].begin(), root_["images"].end(), keep);
        for (const OrderedJson& accessor : root_["accessors"])
        {
            keep(accessor);
            if (accessor.contains("sparse"))
                for (const char* key : {"indices", "values"})
                    keep(accessor["sparse"][key]);
        }
        free_views_.assign(draco_views_.begin(), draco_views_.end());
    }

    /// Notes a view of Draco data. It is unchecked if the file has the same uncompressed.
    void note_draco_view(const OrderedJson& packed)
    {
        if (packed.is_object() && packed.contains("bufferView") &&
            packed["bufferView"].is_number_unsigned() &&
            index_in(packed["bufferView"]) < list("bufferViews").size())
            draco_views_.insert(index_in(packed["bufferView"]));
    }

    void cut_buffers()
    {
        std::map<std::uint64_t, std::vector<std::pair<std::uint64_t, int>>> edges;
        const auto add = [&](const OrderedJson& place, int begin, int end)
        {
            const GltfLayout::Buffer& buffer = layout_.buffers[index_in(place["buffer"])];
            if (buffer.kind == Kind::Unpacked || buffer.kind == Kind::Absent)
                return;
            const std::uint64_t start =
                buffer.start +
                (place.contains("byteOffset") ? index_in(place["byteOffset"]) : 0);
            edges[buffer.start].emplace_back(start, begin);
            edges[buffer.start].emplace_back(start + index_in(place["byteLength"]), end);
        };
        const OrderedJson& views = list("bufferViews");
        for (std::size_t i = 0; i < views.size(); ++i)
        {
            if (draco_views_.contains(i))
                add(views[i], Cuts::kPackedBegins, Cuts::kPackedEnds);
            else
                add(views[i], Cuts::kLiveBegins, Cuts::kLiveEnds);
            // A view that did not have to be unpacked has not been checked.
            const OrderedJson* const packed = extension_in(views[i], kMeshoptExtension);
            if (packed &&
                layout_.buffers[index_in(views[i]["buffer"])].kind == Kind::Unpacked)
                add(*packed, Cuts::kPackedBegins, Cuts::kPackedEnds);
        }
        for (auto& [start, all] : edges)
            cuts_.add(all, start);
        for (const GltfLayout::Buffer& buffer : layout_.buffers)
            bytes_.push_back(
                buffer.kind == Kind::Inside || buffer.kind == Kind::Beside ||
                        buffer.kind == Kind::Chunk
                    ? cuts_.rest(body_, buffer.start, buffer.start + buffer.size)
                    : std::string());
        // An empty buffer is none.
        for (std::size_t b = 0; b < bytes_.size(); ++b)
            if (bytes_[b].empty() && layout_.buffers[b].size > 0)
                bytes_[b].assign(4, '\0');
    }

    /// Views in buffers that have got shorter, and those of what meshopt has compressed.
    void place_views()
    {
        std::map<std::size_t, std::uint64_t> places; // of unpacked buffers in the home
        for (std::size_t b = 0; b < layout_.buffers.size(); ++b)
            if (const GltfLayout::Buffer& buffer = layout_.buffers[b];
                buffer.kind == Kind::Unpacked)
                places[b] =
                    append(std::string_view(body_).substr(buffer.start, buffer.size));
        for (OrderedJson& view : list("bufferViews"))
        {
            erase_extension(view, kMeshoptExtension);
            const std::size_t b = index_in(view["buffer"]);
            const std::uint64_t offset =
                view.contains("byteOffset") ? index_in(view["byteOffset"]) : 0;
            if (const auto place = places.find(b); place != places.end())
            {
                view["buffer"] = *home_;
                view["byteOffset"] = place->second + offset;
                continue;
            }
            const std::uint64_t start = layout_.buffers[b].start;
            if (const std::uint64_t less =
                    cuts_.before(start + offset) - cuts_.before(start);
                less > 0)
                view["byteOffset"] = offset - less;
        }
    }

    /// Accessors whose numbers Draco has compressed, but for those that have new ones.
    void unpack_draco()
    {
        for (std::size_t a = 0; a < layout_.accessors.size(); ++a)
        {
            const GltfAccessor& accessor = layout_.accessors[a];
            if (!accessor.is_draco || redefined_.contains(a))
                continue;
            // Numbers of vertices stand at whole words; a SCALAR may be an index.
            const std::size_t bytes = accessor.element_bytes(),
                              stride = accessor.length == 1 ? bytes : (bytes + 3) / 4 * 4;
            std::string numbers;
            for (std::uint64_t i = 0; i < accessor.count; ++i)
            {
                numbers.append(body_, accessor.start + i * bytes, bytes);
                numbers.resize(static_cast<std::size_t>((i + 1) * stride), '\0');
            }
            OrderedJson& object = root_["accessors"][a];
            object["bufferView"] = new_view(numbers, stride == bytes ? 0 : stride);
            object.erase("byteOffset");
            object["count"] = accessor.count;
        }
        for (OrderedJson& found : root_["meshes"])
            for (OrderedJson& primitive : found["primitives"])
                erase_extension(primitive, kDracoExtension);
    }

    // --- what moves
    // -------------------------------------------------------------------------
    void move()
    {
        std::set<std::size_t> shown;
        for (const GltfLayout::Part& part : layout_.parts)
            shown.insert(part.node);
        std::map<std::size_t, std::size_t> users, moved_users; // of meshes: their places
        const OrderedJson& nodes = root_["nodes"];
        for (std::size_t i = 0; i < nodes.size(); ++i)
            if (nodes[i].contains("mesh") && !shown.contains(i))
                ++users[index_in(nodes[i]["mesh"])];
        for (const GltfLayout::Part& part : layout_.parts)
            ++users[part.mesh];
        for (std::size_t i = 0; i < moved_.size(); i = end_of_part(i))
            ++moved_users[layout_.parts[moved_[i].part].mesh];
        for (std::size_t i = 0; i < moved_.size(); i = end_of_part(i))
        {
            const GltfLayout::Part& part = layout_.parts[moved_[i].part];
            // If nothing shows the mesh as it was any more, a moved one replaces it.
            const std::size_t new_mesh = mesh_of(
                i, moved_users[part.mesh] == users[part.mesh], users[part.mesh] == 1);
            if (part.gpu_instance)
                gpu_meshes_[part.node][*part.gpu_instance] = new_mesh;
            else
                root_["nodes"][part.node]["mesh"] = new_mesh;
        }
        for (const auto& [node, meshes] : gpu_meshes_)
            part_instances(node, meshes);
    }
    /// One past the moved runs of a part.
    std::size_t end_of_part(std::size_t first) const
    {
        std::size_t end = first;
        while (end < moved_.size() && moved_[end].part == moved_[first].part)
            ++end;
        return end;
    }
    /// A mesh with the numbers of the part whose runs begin with \p first: its mesh
    /// itself if that \p is_free and no other part has taken it, else a copy. Parts whose
    /// numbers are the same share it.
    std::size_t mesh_of(std::size_t first, bool is_free, bool is_alone)
    {
        const std::size_t m = layout_.parts[moved_[first].part].mesh;
        std::size_t hash = m;
        for (std::size_t i = first; i < end_of_part(first); ++i)
            hash = hash * 31 + std::hash<std::string>()(moved_[i].numbers);
        const auto [begin, last] = changed_.equal_range(hash);
        for (auto it = begin; it != last; ++it)
            if (are_same(it->second.first, first))
                return it->second.second;
        std::size_t number = m;
        if (!is_free || !taken_.insert(m).second)
        {
            number = root_["meshes"].size();
            root_["meshes"].push_back(meshes_before_[m]);
        }
        use_numbers(number, m, first, is_alone);
        changed_.emplace(hash, std::pair(first, number));
        return number;
    }
    bool are_same(std::size_t a, std::size_t b) const
    {
        const std::size_t length = end_of_part(a) - a;
        if (layout_.parts[moved_[a].part].mesh != layout_.parts[moved_[b].part].mesh ||
            end_of_part(b) - b != length)
            return false;
        for (std::size_t i = 0; i < length; ++i)
        {
            const GltfLayout::Run &x = moved_[a + i].run, &y = moved_[b + i].run;
            if (x.list != y.list || x.accessor != y.accessor ||
                x.position != y.position ||
                moved_[a + i].numbers != moved_[b + i].numbers)
                return false;
        }
        return true;
    }
    /// Has mesh \p m, which is \p of or a copy of it, use the numbers of a part.
    void use_numbers(std::size_t m, std::size_t of, std::size_t first, bool is_alone)
    {
        static constexpr const char* names[] = {"POSITION", "NORMAL", "TANGENT"};
        for (std::size_t i = first; i < end_of_part(first); ++i)
        {
            const MovedRun& moved = moved_[i];
            const bool is_same = is_alone && layout_.uses[moved.run.accessor] == 1 &&
                                 redefined_.insert(moved.run.accessor).second;
            const std::size_t accessor = new_accessor(moved, is_same);
            const OrderedJson& before = meshes_before_[of]["primitives"];
            for (std::size_t p = 0; p < before.size(); ++p)
            {
                const OrderedJson& attributes = before[p]["attributes"];
                const char* const name = names[moved.run.list];
                if (index_in(attributes["POSITION"]) == moved.run.position &&
                    attributes.contains(name) &&
                    index_in(attributes[name]) == moved.run.accessor)
                    mesh(m)["primitives"][p]["attributes"][name] = accessor;
            }
        }
    }
    /// An accessor with a part's numbers: the one that had them, or a new one.
    std::size_t new_accessor(const MovedRun& moved, bool is_same)
    {
        const GltfAccessor& accessor = layout_.accessors[moved.run.accessor];
        OrderedJson object = root_["accessors"][moved.run.accessor];
        const std::size_t number =
            is_same ? moved.run.accessor : root_["accessors"].size();
        for (const char* key : {"byteOffset", "normalized", "sparse"})
            object.erase(key);
        object["bufferView"] = new_view(moved.numbers, 0);
        object["componentType"] = 5126;
        object["count"] = accessor.count;
        GltfLayout::Data data;
        data.length = accessor.length;
        GltfBounds bounds(data);
        const std::size_t size = data.length * sizeof(float);
        for (std::size_t at = 0; at < moved.numbers.size(); at += size)
            bounds.add(moved.numbers.data() + at);
        set_bounds(bounds, object, moved.run.list == 0);
        if (is_same)
            root_["accessors"][number] = std::move(object);
        else
            root_["accessors"].push_back(std::move(object));
        return number;
    }
    static void set_bounds(const GltfBounds& bounds, OrderedJson& accessor,
                           bool must_have)
    {
        if (must_have || accessor.contains("min"))
            accessor["min"] = bounds.least();
        if (must_have || accessor.contains("max"))
            accessor["max"] = bounds.most();
    }
    /// Makes the instances of a node that were drawn at once nodes of their own.
    void part_instances(std::size_t node,
                        const std::map<std::size_t, std::size_t>& meshes)
    {
        const OrderedJson many =
            *extension_in(root_["nodes"][node], kInstancingExtension);
        const std::size_t mesh_before = index_in(root_["nodes"][node]["mesh"]);
        const auto values = [&](const char* name)
        {
            const OrderedJson& attributes = many["attributes"];
            return attributes.contains(name)
                       ? accessor_numbers(layout_.accessors[index_in(attributes[name])],
                                          file_.geometry.unpacked)
                       : std::vector<double>();
        };
        const std::vector<double> shifts = values("TRANSLATION"),
                                  turns = values("ROTATION"), scales = values("SCALE");
        const std::size_t count =
            std::max({shifts.size() / 3, turns.size() / 4, scales.size() / 3});
        OrderedJson children =
            root_["nodes"][node].value("children", OrderedJson::array());
        for (std::size_t k = 0; k < count; ++k)
        {
            OrderedJson child = OrderedJson::object();
            const auto found = meshes.find(k);
            child["mesh"] = found == meshes.end() ? mesh_before : found->second;
            const auto put =
                [&](const char* key, const std::vector<double>& all, std::size_t length)
            {
                if (all.empty())
                    return;
                const auto first = all.begin() + static_cast<std::ptrdiff_t>(k * length);
                child[key] = std::vector<double>(
                    first, first + static_cast<std::ptrdiff_t>(length));
            };
            put("translation", shifts, 3);
            put("rotation", turns, 4);
            put("scale", scales, 3);
            children.push_back(root_["nodes"].size());
            root_["nodes"].push_back(std::move(child));
        }
        OrderedJson& object = root_["nodes"][node];
        object.erase("mesh");
        object["children"] = std::move(children);
        erase_extension(object, kInstancingExtension);
    }

    // --- the file
    // ---------------------------------------------------------------------------
    OrderedJson& list(const char* key)
    {
        static const OrderedJson none = OrderedJson::array();
        if (!root_.contains(key))
            root_[key] = none;
        return root_[key];
    }
    /// Puts bytes at the end of the home. Gives their place there.
    std::uint64_t append(std::string_view more)
    {
        std::string& home = bytes_[*home_];
        align(home);
        const std::uint64_t place = home.size();
        home += more;
        return place;
    }
    std::size_t new_view(const std::string& numbers, std::size_t stride)
    {
        OrderedJson view = {{"buffer", *home_}, {"byteOffset", append(numbers)}};
        view["byteLength"] = numbers.size();
        if (stride > 0)
            view["byteStride"] = stride;
        OrderedJson& views = list("bufferViews");
        if (free_views_.empty())
        {
            views.push_back(std::move(view));
            return views.size() - 1;
        }
        const std::size_t number = free_views_.back();
        free_views_.pop_back();
        views[number] = std::move(view);
        return number;
    }
    /// Names of what the file no longer has; buffers that were there for it alone.
    void forget_extensions()
    {
        std::vector<std::string> gone = {kMeshoptExtension, kDracoExtension};
        if (!gpu_meshes_.empty() &&
            std::none_of(root_["nodes"].begin(), root_["nodes"].end(),
                         [](const OrderedJson& node)
                         { return extension_in(node, kInstancingExtension); }))
            gone.emplace_back(kInstancingExtension);
        for (const char* key : {"extensionsUsed", "extensionsRequired"})
        {
            if (!root_.contains(key) || !root_[key].is_array())
                continue;
            OrderedJson rest = OrderedJson::array();
            for (const OrderedJson& name : root_[key])
                if (std::find(gone.begin(), gone.end(), name) == gone.end())
                    rest.push_back(name);
            if (rest.empty())
                root_.erase(key);
            else
                root_[key] = std::move(rest);
        }
        // Draco's views that are left are none any more; they must name something.
        for (const std::size_t view : free_views_)
            root_["bufferViews"][view] = {
                {"buffer", *home_}, {"byteOffset", 0}, {"byteLength", 4}};
        OrderedJson buffers = OrderedJson::array();
        std::vector<std::size_t> numbers;
        for (std::size_t b = 0; b < layout_.buffers.size(); ++b)
        {
            numbers.push_back(buffers.size());
            if (layout_.buffers[b].kind == Kind::Unpacked)
                continue;
            buffers.push_back(root_["buffers"][b]);
            erase_extension(buffers.back(), kMeshoptExtension);
            kept_.push_back(b);
        }
        root_["buffers"] = std::move(buffers);
        for (OrderedJson& view : list("bufferViews"))
            view["buffer"] = numbers[index_in(view["buffer"])];
    }

    PatchedGltf assembled(const std::string& output)
    {
        PatchedGltf result;
        const std::vector<std::string> paths = output.empty()
                                                   ? std::vector<std::string>()
                                                   : companion_paths(layout_, output);
        std::vector<std::string> uris(layout_.buffers.size());
        for (std::size_t k = 0; k < kept_.size(); ++k)
        {
            const std::size_t b = kept_[k];
            const GltfLayout::Buffer& buffer = layout_.buffers[b];
            OrderedJson& object = root_["buffers"][k];
            if (buffer.kind == Kind::Absent)
                continue;
            const std::size_t own = buffer.kind == Kind::Again ? buffer.twin : b;
            object["byteLength"] = bytes_[own].size();
            uris[b] = buffer.uri;
            if (buffer.kind == Kind::Inside)
                uris[b] = buffer.uri.substr(0, buffer.uri.find(',') + 1) +
                          base64_encoded(bytes_[b]);
            if (buffer.kind == Kind::Beside && !paths.empty())
            {
                const std::string& path = paths[result.companions.size()];
                uris[b] = uri_of(path);
                result.companions.push_back({path, bytes_[b]});
            }
            if (buffer.kind == Kind::Again)
                uris[b] = uri_again(layout_, uris, buffer);
            if (buffer.kind != Kind::Chunk)
                object["uri"] = uris[b];
        }
        const bool is_pretty =
            file_.bytes.find('\n', layout_.json.begin) < layout_.json.end;
        std::string json = root_.dump(is_pretty ? 2 : -1);
        result.bytes = file_.geometry.format == "glb" ? container(std::move(json))
                                                      : std::move(json) + "\n";
        return result;
    }
    /// The binary container with another JSON and another binary chunk.
    std::string container(std::string json) const
    {
        const std::string_view bytes = file_.bytes;
        const auto word = [](std::size_t value)
        {
            std::string text;
            store(static_cast<double>(value), Scalar::UInt32, false, text);
            return text;
        };
        const auto word_at = [&](std::size_t at)
        {
            return static_cast<std::size_t>(
                load_stored(bytes.data() + at, Scalar::UInt32, false));
        };
        const std::size_t end = word_at(8);
        json.resize((json.size() + 3) / 4 * 4, ' ');
        std::string chunks = word(json.size()) + "JSON" + json;
        std::size_t rest = layout_.json.end;
        if (layout_.chunk_start > 0)
        {
            std::string chunk =
                layout_.buffers[0].kind == Kind::Chunk
                    ? bytes_[0]
                    : std::string(bytes.substr(layout_.chunk_start,
                                               word_at(layout_.chunk_start - 8)));
            align(chunk, 4);
            rest = layout_.chunk_start + word_at(layout_.chunk_start - 8);
            chunks += word(chunk.size()) + std::string("BIN\0", 4) + chunk;
        }
        chunks += bytes.substr(rest, end - rest);
        if (12 + chunks.size() > std::numeric_limits<std::uint32_t>::max())
            throw Error(Fault::Usage,
                        at({file_.path, 0, ""}, "needs more than the 4 GB that a .glb "
                                                "holds, unpacked: make a .gltf of it"));
        std::string out(bytes.substr(0, 8));
        out += word(12 + chunks.size());
        out += chunks;
        out += bytes.substr(end);
        return out;
    }

    const GeometryFile& file_;
    const GltfLayout& layout_;
    const std::string body_;
    const std::vector<MovedRun>& moved_;
    OrderedJson root_;
    const OrderedJson meshes_before_;
    std::optional<std::size_t> home_;
    Cuts cuts_;
    std::vector<std::string> bytes_; ///< of the buffers that the file has
    std::set<std::size_t> draco_views_;
    std::vector<std::size_t> free_views_; ///< of those, without data now
    std::set<std::size_t> redefined_;     ///< accessors with new numbers
    std::set<std::size_t> taken_;         ///< meshes that changed themselves
    std::multimap<std::size_t, std::pair<std::size_t, std::size_t>>
        changed_; ///< meshes by hash: first moved run, mesh
    std::map<std::size_t, std::map<std::size_t, std::size_t>>
        gpu_meshes_;                ///< of instances of nodes
    std::vector<std::size_t> kept_; ///< buffers
};

} // namespace

PatchedGltf rebuilt_gltf(const GeometryFile& file, std::string body,
                         const std::vector<GltfBounds>& bounds,
                         const std::vector<MovedRun>& moved, const std::string& output)
{
    return Rebuild(file, std::move(body), moved).run(bounds, output);
}

} // namespace cellwarp::core
