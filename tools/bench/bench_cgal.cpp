// The thin shim round CGAL's Surface_mesh_simplification.
#include "bench_cgal.h"
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/repair.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Bounded_normal_change_placement.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/GarlandHeckbert_plane_policies.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_cost.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_placement.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>
#include <array>
#include <ctime>
#include <exception>
#include <vector>

namespace PMP = CGAL::Polygon_mesh_processing;
namespace SMS = CGAL::Surface_mesh_simplification;
using Kernel = CGAL::Simple_cartesian<double>;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;

// CGAL's own predicate counts edges, with some that are gone.
struct face_count_stop {
    std::size_t target;
    template <typename F, typename Profile>
    bool operator()(const F &, const Profile &profile, std::size_t, std::size_t) const
    {
        return profile.surface_mesh().number_of_faces() <= target;
    }
};

static double thread_seconds()
{
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

// Edges and vertices that are not manifold are cut open.
static bool fill(Mesh &mesh, const double *positions, uint32_t vertex_count,
                 const uint32_t *indices, uint32_t index_count)
{
    std::vector<Kernel::Point_3> points;
    std::vector<std::array<std::size_t, 3>> faces;
    for (uint32_t v = 0; v < vertex_count; v++)
        points.emplace_back(positions[3 * v], positions[3 * v + 1], positions[3 * v + 2]);
    for (uint32_t i = 0; i + 2 < index_count; i += 3)
        faces.push_back({indices[i], indices[i + 1], indices[i + 2]});
    PMP::orient_polygon_soup(points, faces);
    if (!PMP::is_polygon_soup_a_polygon_mesh(faces))
        return false;
    PMP::polygon_soup_to_polygon_mesh(points, faces, mesh);
    PMP::remove_isolated_vertices(mesh);
    return true;
}

static void read_back(Mesh &mesh, double *positions, uint32_t *vertex_count, uint32_t *indices,
                      uint32_t *index_count)
{
    mesh.collect_garbage();
    *vertex_count = *index_count = 0;
    for (auto v : mesh.vertices()) {
        const auto &p = mesh.point(v);
        for (int i = 0; i < 3; i++)
            positions[3 * *vertex_count + uint32_t(i)] = p[i];
        ++*vertex_count;
    }
    for (auto f : mesh.faces())
        for (auto v : vertices_around_face(mesh.halfedge(f), mesh))
            indices[(*index_count)++] = uint32_t(v);
}

extern "C" int bench_cgal_simplify(bench_cgal_policy policy, double *positions,
                                   uint32_t *vertex_count, uint32_t *indices, uint32_t *index_count,
                                   uint32_t face_target, double *cpu_seconds)
try {
    Mesh mesh;
    if (!fill(mesh, positions, *vertex_count, indices, *index_count))
        return 0;
    double start = thread_seconds();
    const face_count_stop stop{face_target};
    if (policy == BENCH_CGAL_LINDSTROM_TURK) {
        SMS::edge_collapse(mesh, stop,
                           CGAL::parameters::get_cost(SMS::LindstromTurk_cost<Mesh>())
                               .get_placement(SMS::LindstromTurk_placement<Mesh>()));
    } else {
        using Policies = SMS::GarlandHeckbert_plane_policies<Mesh, Kernel>;
        Policies policies(mesh);
        SMS::Bounded_normal_change_placement<Policies::Get_placement> placement(
            policies.get_placement());
        SMS::edge_collapse(
            mesh, stop, CGAL::parameters::get_cost(policies.get_cost()).get_placement(placement));
    }
    *cpu_seconds = thread_seconds() - start;
    read_back(mesh, positions, vertex_count, indices, index_count);
    return 1;
} catch (const std::exception &) {
    return 0;
}
