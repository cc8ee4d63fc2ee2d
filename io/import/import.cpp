// SPDX-License-Identifier: GPL-3.0-or-later
// The library runs in a process of its own: on a malformed file it may crash, hang or
// take all memory, and then only that process ends.
#include "io/import/import.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <exception>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "io/error.h"
#include "io/number.h"

namespace cellwarp
{

namespace
{

constexpr rlim_t kMaxSeconds = 300;
constexpr std::uint64_t kMaxNesting = 1000;
/// Samples that instances of meshes may come to.
constexpr std::uint64_t kMaxSamples = 100000000;

/// Opens nothing: the bytes are all there is.
class NoFiles : public Assimp::IOSystem
{
public:
    bool Exists(const char*) const override { return false; }
    char getOsSeparator() const override { return '/'; }
    Assimp::IOStream* Open(const char*, const char*) override { return nullptr; }
    void Close(Assimp::IOStream*) override {}
};

/// What the other process hands back, or why it could not.
struct Imported
{
    std::string problem;
    std::vector<Eigen::Vector3d> samples, directions;
    std::vector<std::uint32_t> direction_samples, corners;
    std::vector<std::uint64_t> face_ends;
};

Eigen::Affine3d affine(const aiMatrix4x4& matrix)
{
    Eigen::Affine3d map = Eigen::Affine3d::Identity();
    for (unsigned row = 0; row < 3; ++row)
        for (unsigned column = 0; column < 4; ++column)
            map(row, column) = static_cast<double>(matrix[row][column]);
    return map;
}

Eigen::Vector3d vector(const aiVector3D& v)
{
    return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
}

/// One mesh under one node; false if it cannot be trusted.
bool add_mesh(const aiMesh& mesh, const Eigen::Affine3d& to_world, Imported& out)
{
    const std::size_t first = out.samples.size();
    if (mesh.mNumVertices > kMaxSamples - first)
    {
        out.problem = "more than 100000000 samples";
        return false;
    }
    const Eigen::FullPivLU<Eigen::Matrix3d> linear(to_world.linear());
    const Eigen::Matrix3d of_normals = linear.isInvertible()
                                           ? Eigen::Matrix3d(linear.inverse().transpose())
                                           : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
    for (unsigned i = 0; i < mesh.mNumVertices; ++i)
    {
        const Eigen::Vector3d x = to_world * vector(mesh.mVertices[i]);
        if (!x.allFinite())
        {
            out.problem =
                "vertex " + std::to_string(out.samples.size()) + ": is not finite";
            return false;
        }
        if (mesh.HasNormals())
        {
            const Eigen::Vector3d normal = of_normals * vector(mesh.mNormals[i]);
            if (normal.allFinite() && normal.norm() > 0)
            {
                out.directions.push_back(normal.normalized());
                out.direction_samples.push_back(
                    static_cast<std::uint32_t>(out.samples.size()));
            }
        }
        out.samples.push_back(x);
    }
    for (unsigned f = 0; f < mesh.mNumFaces; ++f)
    {
        const aiFace& face = mesh.mFaces[f];
        for (unsigned k = 0; k < face.mNumIndices; ++k)
            if (face.mIndices[k] >= mesh.mNumVertices)
            {
                out.problem = "face " + std::to_string(f) +
                              ": its index is out of range (got " +
                              std::to_string(face.mIndices[k]) + ")";
                return false;
            }
        if (face.mNumIndices < 3)
            continue; // a point or a line
        for (unsigned k = 0; k < face.mNumIndices; ++k)
            out.corners.push_back(static_cast<std::uint32_t>(first + face.mIndices[k]));
        out.face_ends.push_back(out.corners.size());
    }
    return true;
}

void add_scene(const aiScene& scene, Imported& out)
{
    struct Visit
    {
        const aiNode* node;
        std::uint64_t depth;
        Eigen::Affine3d to_world;
    };
    std::vector<Visit> rest = {
        {scene.mRootNode, 1, affine(scene.mRootNode->mTransformation)}};
    while (!rest.empty())
    {
        const Visit visit = rest.back();
        rest.pop_back();
        if (visit.depth > kMaxNesting)
        {
            out.problem = "nodes are nested deeper than 1000";
            return;
        }
        for (unsigned m = 0; m < visit.node->mNumMeshes; ++m)
            if (visit.node->mMeshes[m] >= scene.mNumMeshes ||
                !add_mesh(*scene.mMeshes[visit.node->mMeshes[m]], visit.to_world, out))
                return;
        for (unsigned c = visit.node->mNumChildren; c-- > 0;)
        {
            const aiNode* child = visit.node->mChildren[c];
            rest.push_back({child, visit.depth + 1,
                            visit.to_world * affine(child->mTransformation)});
        }
    }
}

/// Vertices that agree in place and normal become one, so that closed meshes stay
/// closed; what else would tell them apart is dropped first.
Imported imported(const std::string& bytes, const std::string& extension)
{
    Imported out;
    Assimp::Importer importer;
    importer.SetIOHandler(new NoFiles); // it takes it over
    importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS,
                                aiComponent_TANGENTS_AND_BITANGENTS | aiComponent_COLORS |
                                    aiComponent_TEXCOORDS | aiComponent_BONEWEIGHTS |
                                    aiComponent_ANIMATIONS | aiComponent_TEXTURES |
                                    aiComponent_LIGHTS | aiComponent_CAMERAS);
    const aiScene* scene = importer.ReadFileFromMemory(
        bytes.data(), bytes.size(),
        aiProcess_RemoveComponent | aiProcess_JoinIdenticalVertices, extension.c_str());
    if (!scene || !scene->mRootNode)
        out.problem = "cannot be imported: " + std::string(importer.GetErrorString());
    else
        add_scene(*scene, out);
    if (out.problem.empty() && out.samples.empty())
        out.problem = "no vertices";
    return out;
}

// --- between the processes: each list as its length and its bytes
// -----------------------

template <class Item>
void put(const std::vector<Item>& items, std::string& out)
{
    const std::uint64_t count = items.size();
    out.append(reinterpret_cast<const char*>(&count), sizeof count);
    out.append(reinterpret_cast<const char*>(items.data()), count * sizeof(Item));
}

template <class Item>
bool take(std::string_view& bytes, std::vector<Item>& items)
{
    std::uint64_t count;
    if (bytes.size() < sizeof count)
        return false;
    std::memcpy(&count, bytes.data(), sizeof count);
    bytes.remove_prefix(sizeof count);
    if (count > bytes.size() / sizeof(Item))
        return false;
    items.resize(static_cast<std::size_t>(count));
    std::memcpy(static_cast<void*>(items.data()), bytes.data(), count * sizeof(Item));
    bytes.remove_prefix(count * sizeof(Item));
    return true;
}

void limit(__rlimit_resource resource, rlim_t value)
{
    struct rlimit now;
    ::getrlimit(resource, &now);
    now.rlim_cur = std::min(value, now.rlim_max);
    ::setrlimit(resource, &now);
}

/// The other process: silent, limited, and over when it has written to \p pipe.
[[noreturn]] void run_importer(const std::string& bytes, const std::string& extension,
                               int pipe)
{
    for (const int signal : {SIGINT, SIGTERM, SIGABRT, SIGSEGV})
        std::signal(signal, SIG_DFL);
    limit(RLIMIT_CORE, 0);
    limit(RLIMIT_CPU, kMaxSeconds);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    // A sanitizer needs terabytes of address space.
    limit(RLIMIT_AS, (rlim_t(4) << 30) + 64 * bytes.size());
#endif
    const int nothing = ::open("/dev/null", O_RDWR | O_CLOEXEC);
    ::dup2(nothing, 1);
    ::dup2(nothing, 2);
    std::string result;
    try
    {
        const Imported found = imported(bytes, extension);
        put(std::vector<char>(found.problem.begin(), found.problem.end()), result);
        put(found.samples, result);
        put(found.directions, result);
        put(found.direction_samples, result);
        put(found.corners, result);
        put(found.face_ends, result);
    }
    catch (...)
    {
        ::_exit(1);
    }
    for (std::size_t done = 0; done < result.size();)
    {
        const ssize_t wrote = ::write(pipe, result.data() + done, result.size() - done);
        if (wrote <= 0)
            ::_exit(1);
        done += static_cast<std::size_t>(wrote);
    }
    ::_exit(0);
}

/// All that comes out of \p pipe until it is closed.
std::string all_of(int pipe)
{
    std::string bytes;
    char part[65536];
    for (;;)
    {
        const ssize_t got = ::read(pipe, part, sizeof part);
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return bytes;
        bytes.append(part, static_cast<std::size_t>(got));
    }
}

} // namespace

bool is_import_format(std::string_view extension)
{
    return !extension.empty() &&
           Assimp::Importer().IsExtensionSupported("." + std::string(extension));
}

Geometry import_geometry(const std::string& path, const std::string& bytes)
{
    const std::string extension = extension_of(path);
    if (bytes.empty())
        throw malformed({path, 0, ""}, "the file is empty: no vertices");
    int pipe[2];
    if (::pipe2(pipe, O_CLOEXEC) != 0)
        throw Error(Fault::File, at({path, 0, ""}, "cannot start the importer"));
    const pid_t process = ::fork();
    if (process == 0)
        run_importer(bytes, extension, pipe[1]);
    ::close(pipe[1]);
    const std::string result = process < 0 ? std::string() : all_of(pipe[0]);
    ::close(pipe[0]);
    if (process < 0)
        throw Error(Fault::File, at({path, 0, ""}, "cannot start the importer"));
    int status = 0;
    while (::waitpid(process, &status, 0) < 0 && errno == EINTR)
        ;
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
        throw malformed({path, 0, ""},
                        "cannot be imported: the importer " +
                            (WIFSIGNALED(status)
                                 ? "ended with signal " + std::to_string(WTERMSIG(status))
                                 : std::string("gave up")));
    Imported found;
    std::vector<char> problem;
    std::string_view rest = result;
    const bool is_whole = take(rest, problem) && take(rest, found.samples) &&
                          take(rest, found.directions) &&
                          take(rest, found.direction_samples) &&
                          take(rest, found.corners) && take(rest, found.face_ends);
    if (!is_whole || !problem.empty())
        throw malformed({path, 0, ""},
                        is_whole ? std::string(problem.begin(), problem.end())
                                 : "cannot be imported: the importer ended early");
    Geometry out;
    out.format = extension;
    out.samples = std::move(found.samples);
    out.directions = std::move(found.directions);
    out.direction_samples = std::move(found.direction_samples);
    out.corners = std::move(found.corners);
    out.face_ends = std::move(found.face_ends);
    if (!out.directions.empty())
        out.attributes.push_back("normals");
    out.not_writable = "a ." + extension + " can only be read";
    out.warnings.push_back(
        at({path, 0, ""}, "imported: coordinates are 32-bit floats, vertices may be "
                          "split and reordered, and only samples, faces and normals are "
                          "kept"));
    return out;
}

} // namespace cellwarp
