// Optimises all meshes of a folder on a server, by HTTP. Nextflow finds bin/optimise-http.sh, which needs curl and jq.
//   nextflow run deploy/workflows/http/main.nf --http https://varimesh.example --meshes 'meshes/*.msh'
// If the server asks for tokens, VARIMESH_TOKEN has one. A run that is resumed joins the jobs that there are.
nextflow.enable.dsl = 2

params.http = 'http://127.0.0.1:8080'
params.meshes = 'meshes/*.msh'
params.results = 'results'

process OPTIMISE {
    tag "${mesh.name}"
    publishDir params.results, mode: 'copy'
    maxForks 16                                              // a task only waits
    errorStrategy { task.exitStatus == 5 ? 'retry' : 'terminate' }
    maxRetries 5

    input:
    path mesh

    output:
    path "${mesh.baseName}.vtu"

    script:
    """
    HTTP=${params.http} optimise-http.sh ${mesh} ${mesh.baseName}.vtu
    """
}

workflow {
    OPTIMISE(Channel.fromPath(params.meshes))
}
