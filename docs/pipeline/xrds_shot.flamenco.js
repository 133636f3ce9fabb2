// A Flamenco job type: a shot of a .blend file at full size, with XRDS.
// Lies in the Manager's folder `scripts`. The workers render chunks of frames in any
// order and keep their samples; when all are there, the shot is denoised, each frame
// with its neighbours' samples. A worker whose Blender lacks XRDS fails its task.

const JOB_TYPE = {
    label: "XRDS Shot",
    description: "Render a shot in chunks, then denoise it as a whole",
    settings: [
        {
            key: "frames", type: "string", required: true,
            eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
            description: "Frames to render, as 47, 1-30 or 1, 3, 5-10",
        },
        {
            key: "chunk_size", type: "int32", default: 24,
            description: "Frames of one task: a worker loads the scene once for all",
        },
        {
            key: "temporal_radius", type: "int32", default: 4,
            description: "Frames before and after that lend their samples",
        },
        {
            key: "render_output_root", type: "string", subtype: "dir_path",
            required: true, visible: "submission",
            description: "Folder below which the job's own folder is made",
        },
        {
            key: "render_output_path", type: "string", subtype: "file_path",
            editable: false,
            eval: "str(Path(abspath(settings.render_output_root), jobname, '{timestamp}', '######.exr'))",
            description: "Where the frames go",
        },
        {
            key: "samples_path", type: "string", subtype: "dir_path",
            editable: false,
            eval: "str(Path(abspath(settings.render_output_root), jobname, '{timestamp}', 'samples'))",
            description: "Where the frames' samples go; not needed once the shot is done",
        },
        { key: "blendfile", type: "string", required: true, visible: "web" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    const radius = `${settings.temporal_radius}`;
    const chunks = frameChunker(settings.frames, settings.chunk_size);
    const rendered = chunks.map((chunk) => addTask(job, `render-${chunk}`, [
        "render", settings.blendfile,
        "--frames", chunk, "--temporal-radius", radius,
        "--sample-cache", settings.samples_path,
    ]));
    // A chunk waits for those that its frames take samples of.
    const reach = Math.ceil(settings.temporal_radius / settings.chunk_size);
    chunks.forEach((chunk, i) => {
        const task = addTask(job, `denoise-${chunk}`, [
            "denoise", `${settings.samples_path}/####.exr`,
            "--out", settings.render_output_path,
            "--frames", chunk, "--temporal-radius", radius,
            "--picture-only", "--resume",
        ]);
        const around = rendered.slice(Math.max(0, i - reach), i + reach + 1);
        for (const each of around) task.addDependency(each);
    });
}

function addTask(job, name, args) {
    const task = author.Task(name, "blender");
    task.addCommand(author.Command("exec", {
        exe: "{blender}",
        args: ["--command", "xrds", ...args],
    }));
    job.addTask(task);
    return task;
}
