//! `splitsnow serve`: the page and its messages over HTTP, and requests that mean harm.
#![allow(clippy::unwrap_used)]
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::cargo::cargo_bin;
use base64::Engine;
use serde_json::{Value, json};

/// A server that is stopped at the end of a test.
struct Server {
    process: Child,
    port: u16,
    token: String,
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Status, headers and body of an answer.
struct Answer {
    status: u16,
    headers: String,
    body: Vec<u8>,
}

impl Answer {
    fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap()
    }

    fn header(&self, name: &str) -> Option<&str> {
        let mut lines = self
            .headers
            .lines()
            .filter_map(|line| line.split_once(": "));
        lines.find_map(|(key, value)| key.eq_ignore_ascii_case(name).then_some(value))
    }
}

impl Server {
    fn start() -> Self {
        Self::of(Command::new(cargo_bin!("splitsnow")).args(["serve", "--threads", "1"]))
    }

    fn of(command: &mut Command) -> Self {
        let mut process = command
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let output = process.stdout.take().unwrap();
        BufReader::new(output).read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("http://127.0.0.1:").unwrap();
        let (port, token) = address.trim_end_matches('/').split_once('/').unwrap();
        assert_eq!(token.len(), 32);
        Self {
            process,
            port: port.parse().unwrap(),
            token: token.to_owned(),
        }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        let patience = Some(Duration::from_secs(120));
        stream.set_read_timeout(patience).unwrap();
        stream
    }

    /// Sends `text` as it is and reads the answer.
    fn send(&self, text: &[u8]) -> Answer {
        let mut stream = self.connect();
        // the server may answer before it has read everything
        let _ = stream.write_all(text);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let end = answer.windows(4).position(|four| four == b"\r\n\r\n");
        let end = end.unwrap_or_else(|| panic!("{}", String::from_utf8_lossy(&answer)));
        let headers = String::from_utf8(answer[..end].to_vec()).unwrap();
        let status = headers.split(' ').nth(1).unwrap().parse().unwrap();
        Answer {
            status,
            body: answer[end + 4..].to_vec(),
            headers,
        }
    }

    fn request(&self, method: &str, path: &str, headers: &str, body: &[u8]) -> Answer {
        let host = match headers.to_lowercase().contains("host:") {
            true => String::new(),
            false => format!("Host: 127.0.0.1:{}\r\n", self.port),
        };
        let length = body.len();
        let head = format!(
            "{method} {path} HTTP/1.1\r\n{host}{headers}Content-Length: {length}\r\nConnection: close\r\n\r\n"
        );
        self.send(&[head.as_bytes(), body].concat())
    }

    fn get(&self, path: &str) -> Answer {
        self.request("GET", &format!("/{}/{path}", self.token), "", b"")
    }

    fn ask_as(&self, client: &str, message: &Value) -> Answer {
        let headers = format!("Content-Type: application/json\r\nX-SPLITSnow-Client: {client}\r\n");
        let body = message.to_string();
        self.request(
            "POST",
            &format!("/{}/ask", self.token),
            &headers,
            body.as_bytes(),
        )
    }

    fn ask(&self, message: &Value) -> Value {
        let answer = self.ask_as("page", message);
        assert_eq!(answer.status, 200);
        answer.json()
    }
}

const JSON: &str = "Content-Type: application/json\r\n";

fn sample(server: &Server) -> Value {
    let about = server.ask(&json!({ "ask": "about" }));
    assert_eq!(about["build"], "native");
    let mut sample = about["presets"][0]["sample"].clone();
    sample["wavelengths"] = json!({ "values_nm": [450, 550, 650] });
    sample
}

#[test]
fn the_page_and_its_messages() {
    let server = Server::start();
    let page = server.get("");
    assert_eq!(page.status, 200);
    let text = String::from_utf8(page.body.clone()).unwrap();
    assert!(text.contains(r#"name="splitsnow-engine" content="server""#));
    // every file that the page names is there
    let names = text
        .split('"')
        .filter(|name| name.starts_with("./") && name.len() > 2);
    let names: Vec<&str> = names.collect();
    assert!(names.len() >= 2, "{text}");
    for name in names {
        let file = server.get(&name[2..]);
        assert_eq!(file.status, 200, "{name}");
        assert!(!file.body.is_empty(), "{name}");
    }
    // the numbers are those of the library
    let sample = sample(&server);
    let message = json!({ "ask": "simulate", "sample": sample, "rays": 512, "seed": 1 });
    let answered = server.ask(&message);
    let mut own = splitsnow::page::PageEngine::default();
    let own = own.answer(message.to_string().as_bytes(), &[]).json;
    let own: Value = serde_json::from_str(&own).unwrap();
    assert_eq!(answered, own);
    // bytes travel as base64, and a client has its own files
    let point = json!({ "facetness": 0.3, "grain_size_um": 300, "density_kg_m3": 275,
        "thickness_cm": 9, "incidence_angle_deg": 20 });
    let bytes = std::fs::read("examples/mitsuba/snow.safetensors").unwrap();
    let data = base64::engine::general_purpose::STANDARD.encode(bytes);
    let file = server.ask(&json!({ "ask": "open", "name": "snow", "data": data }));
    let message = json!({ "ask": "lookup", "id": file["id"], "point": point });
    assert!(server.ask(&message)["reflectance"].is_array());
    let other = server.ask_as("other", &message).json();
    assert!(
        other["error"].as_str().unwrap().contains("not open"),
        "{other}"
    );
}

#[test]
fn every_answer_forbids_what_the_page_does_not_need() {
    let server = Server::start();
    let answers = [
        server.get(""),
        server.get("nothing.js"),
        server.ask_as("page", &json!({ "ask": "about" })),
        server.request("GET", "/", "Host: evil.example\r\n", b""),
    ];
    for answer in &answers {
        let policy = answer.header("content-security-policy").unwrap();
        assert!(policy.starts_with("default-src 'self'"), "{policy}");
        assert_eq!(answer.header("x-content-type-options"), Some("nosniff"));
        assert_eq!(answer.header("referrer-policy"), Some("no-referrer"));
        assert_eq!(answer.header("cache-control"), Some("no-store"));
        assert_eq!(answer.header("access-control-allow-origin"), None);
        assert_eq!(answer.header("set-cookie"), None);
    }
}

#[test]
fn requests_of_others_are_refused() {
    let server = Server::start();
    let ask = format!("/{}/ask", server.token);
    let about = br#"{"ask":"about"}"#;
    let own = format!("Origin: http://127.0.0.1:{}\r\n{JSON}", server.port);
    assert_eq!(server.request("POST", &ask, &own, about).status, 200);
    let wrong_token = format!("/{}/ask", "0".repeat(32));
    let cases: [(&str, &str, &str, &[u8], u16); 16] = [
        ("POST", "/ask", JSON, about, 404),
        ("POST", &wrong_token, JSON, about, 404),
        ("GET", "/", "", b"", 404),
        ("GET", &wrong_token, "", b"", 404),
        // another host, as after DNS rebinding
        (
            "POST",
            &ask,
            &format!("Host: evil.example\r\n{JSON}"),
            about,
            403,
        ),
        (
            "POST",
            &ask,
            &format!("Host: 127.0.0.1\r\n{JSON}"),
            about,
            403,
        ),
        // another page
        (
            "POST",
            &ask,
            &format!("Origin: http://evil.example\r\n{JSON}"),
            about,
            403,
        ),
        ("POST", &ask, &format!("Origin: null\r\n{JSON}"), about, 403),
        (
            "POST",
            &ask,
            &format!("Sec-Fetch-Site: cross-site\r\n{JSON}"),
            about,
            403,
        ),
        // a form, which needs no permission of another origin
        ("POST", &ask, "Content-Type: text/plain\r\n", about, 415),
        ("POST", &ask, "", about, 415),
        // what a browser asks before it sends JSON elsewhere
        (
            "OPTIONS",
            &ask,
            "Access-Control-Request-Method: POST\r\n",
            b"",
            405,
        ),
        ("GET", &ask, "", b"", 404),
        ("PUT", &ask, JSON, about, 405),
        ("POST", &ask, JSON, b"not json", 400),
        (
            "POST",
            &ask,
            JSON,
            br#"{"ask":"open","name":"x","data":"%%"}"#,
            400,
        ),
    ];
    for (method, path, headers, body, status) in cases {
        let answer = server.request(method, path, headers, body);
        assert_eq!(answer.status, status, "{method} {path} {headers}");
        assert!(
            answer.json()["error"].is_string(),
            "{method} {path} {headers}"
        );
    }
    // no file but those of the page
    for path in [
        "../Cargo.toml",
        "..%2fCargo.toml",
        "%2e%2e/Cargo.toml",
        "/etc/passwd",
        "assets/",
    ] {
        assert_eq!(server.get(path).status, 404, "{path}");
    }
    let long_name = format!("X-SPLITSnow-Client: {}\r\n{JSON}", "x".repeat(65));
    assert_eq!(server.request("POST", &ask, &long_name, about).status, 400);
    let refused = server.ask(&json!({ "ask": "sample", "sample": "/etc/passwd" }));
    assert!(refused["error"].is_string());
}

#[test]
fn large_requests_are_refused() {
    let server = Server::start();
    let ask = format!("/{}/ask", server.token);
    let body = vec![b' '; splitsnow::serve::MOST_BYTES + 1];
    assert_eq!(server.request("POST", &ask, JSON, &body).status, 413);
    // a length that is only claimed costs nothing
    let head = format!(
        "POST {ask} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n{JSON}Content-Length: 99999999999\r\n\r\n",
        server.port
    );
    let mut stream = server.connect();
    stream.write_all(head.as_bytes()).unwrap();
    stream.shutdown(Shutdown::Write).unwrap();
    let sample = sample(&server);
    let too_much = [
        ("rays", json!(u64::MAX)),
        (
            "sample",
            json!({ "wavelengths": { "start_nm": 350, "stop_nm": 2500, "step_nm": 1e-6 } }),
        ),
        ("sample", json!({ "layer": vec![json!({}); 21] })),
    ];
    for (key, value) in too_much {
        let mut message = json!({ "ask": "simulate", "sample": sample, "rays": 64, "seed": 1 });
        message[key] = value;
        let refused = server.ask(&message);
        let error = refused["error"].as_str().unwrap();
        assert!(error.contains("more than"), "{key}: {error}");
    }
    // requests that are no HTTP, and a connection that says nothing, hurt nobody
    for garbage in [&b"\0\0\0\0\r\n\r\n"[..], b"GET\r\n\r\n", &[b'x'; 100_000]] {
        let mut stream = server.connect();
        let _ = stream.write_all(garbage);
    }
    let _silent = server.connect();
    assert_eq!(server.get("").status, 200);
}

/// Connections that say nothing use up the descriptors; the server closes them and goes on.
#[cfg(unix)]
#[test]
fn a_server_without_descriptors_goes_on() {
    let program = cargo_bin!("splitsnow").display().to_string();
    let limited = format!("ulimit -n 48; exec '{program}' serve --threads 1");
    let server = Server::of(Command::new("sh").args(["-c", &limited]));
    let _silent: Vec<TcpStream> = (0..60).map(|_| server.connect()).collect();
    assert_eq!(server.get("").status, 200);
}

/// No number of connections takes all descriptors, and those that are slow are closed.
#[cfg(target_os = "linux")]
#[test]
fn slow_connections_are_few_and_closed() {
    let server = Server::start();
    let began = Instant::now();
    let head = format!(
        "POST /{}/ask HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n{JSON}Content-Length: 100\r\n\r\n",
        server.token, server.port
    );
    // nothing, half a head, and half a body
    let slow = ["", &head[..40], &head, &format!("{head}{{")].map(|text| {
        let mut stream = server.connect();
        stream.write_all(text.as_bytes()).unwrap();
        stream
    });
    let crowd: Vec<TcpStream> = (0..300).map(|_| server.connect()).collect();
    std::thread::sleep(Duration::from_secs(1));
    let descriptors = format!("/proc/{}/fd", server.process.id());
    let descriptors = std::fs::read_dir(descriptors).unwrap().count();
    assert!(descriptors > 128, "{descriptors}: the crowd is there");
    assert!(descriptors < 128 + 32, "{descriptors}");
    let answers = slow.map(|mut stream| {
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    });
    let waited = began.elapsed();
    assert!(waited > Duration::from_secs(5), "{waited:?}");
    assert!(waited < Duration::from_secs(60), "{waited:?}");
    for (answer, status) in answers.iter().zip(["", "", "408", "408"]) {
        assert_eq!(answer.split(' ').nth(1).unwrap_or(""), status, "{answer}");
    }
    drop(crowd);
    assert_eq!(server.get("").status, 200);
}

/// A file of a spectrum whose rows all count.
fn rows_of_a_file(rows: usize) -> String {
    let row = |i: usize| format!("{},0.5\n", 400.0 + 2000.0 * i as f64 / rows as f64);
    "wavelength_nm,reflectance\n".to_owned() + &(0..rows).map(row).collect::<String>()
}

/// What a message of the largest size holds does not multiply in memory.
#[cfg(target_os = "linux")]
#[test]
fn large_messages_take_little_memory() {
    let list = |value: &str| {
        let list = vec![value; (23 << 20) / (value.len() + 1)].join(",");
        format!(r#"{{"ask":"colour","wavelengths_nm":[{list}]}}"#)
    };
    let most = splitsnow::serve::MOST_BYTES - 100;
    let measured = |text: &str| {
        let mut message = json!({ "ask": "measured", "name": "x.csv", "text": text });
        for key in [
            "wavelengths_nm",
            "reflectance",
            "reflectance_se",
            "transmittance",
            "transmittance_se",
        ] {
            message[key] = json!([500]);
        }
        message.to_string()
    };
    let cases = [
        (list("1"), 413),
        (list("{}"), 413),
        (list("[[[[]]]]"), 413),
        (list(&"9".repeat(60)), 200),
        (measured(&"1,1\n".repeat(4_000_000)), 200),
        (measured(&"1 ".repeat(8_000_000)), 200),
        (measured(&("1|".repeat(1000) + "\n").repeat(8000)), 200),
        // just under the limit of the cells
        (measured(&"500,0.5\n".repeat(499_000)), 200),
        (measured(&"a,500,0.5\n".repeat(332_000)), 200),
        (measured(&rows_of_a_file(331_000)), 200),
        (
            format!(r#"{{"ask":"about","x":"{}"}}"#, r#"\",["#.repeat(most / 4)),
            200,
        ),
        (
            format!(
                r#"{{"ask":"open","name":"x","data":"{}"}}"#,
                "AAAA".repeat(most / 4)
            ),
            200,
        ),
    ];
    for (body, status) in cases {
        let server = Server::start();
        let ask = format!("/{}/ask", server.token);
        let answer = server.request("POST", &ask, JSON, body.as_bytes());
        let start = &body[..60];
        assert_eq!(answer.status, status, "{start}");
        let status = format!("/proc/{}/status", server.process.id());
        let status = std::fs::read_to_string(status).unwrap();
        let most = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let most = most.unwrap().trim().trim_end_matches(" kB");
        let most = most.parse::<f64>().unwrap() / 1000.0;
        assert!(most < 130.0, "{start}: {most} MB");
    }
}

/// A message whose client hangs up is cancelled: the next one does not wait for it.
#[test]
fn a_client_that_hangs_up_cancels_its_message() {
    let server = Server::start();
    let mut sample = sample(&server);
    sample["wavelengths"] = json!({ "start_nm": 350, "stop_nm": 2500, "step_nm": 10 });
    // ten layers, each plane between two of which is walked
    let mut layers = vec![sample["layer"][0].clone(); 10];
    for (i, layer) in layers.iter_mut().enumerate() {
        layer["density_kg_m3"] = json!(200 + 20 * i);
        layer["thickness_cm"] = json!(10);
    }
    sample["layer"] = json!(layers);
    let long = json!({ "ask": "simulate", "sample": sample, "rays": 1 << 20, "seed": 1 });
    let body = long.to_string();
    let head = format!(
        "POST /{}/ask HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n{JSON}X-SPLITSnow-Client: page\r\nContent-Length: {}\r\n\r\n",
        server.token,
        server.port,
        body.len()
    );
    let mut stream = server.connect();
    stream.write_all((head + &body).as_bytes()).unwrap();
    let brief = Some(Duration::from_millis(500));
    stream.set_read_timeout(brief).unwrap();
    assert!(stream.read(&mut [0; 1]).is_err(), "it is answered at once");
    // it would take many minutes
    drop(stream);
    let cancelled = Instant::now();
    server.ask(&json!({ "ask": "about" }));
    let waited = cancelled.elapsed();
    assert!(waited < Duration::from_secs(30), "{waited:?}");
}

#[test]
fn a_port_that_is_taken_is_named() {
    let server = Server::start();
    let port = server.port.to_string();
    let second = Command::new(cargo_bin!("splitsnow"))
        .args(["serve", "--port", &port])
        .output()
        .unwrap();
    assert_eq!(second.status.code(), Some(1));
    let errors = String::from_utf8(second.stderr).unwrap();
    assert!(errors.contains(&format!("port {port}")), "{errors}");
}
